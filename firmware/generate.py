"""Write protocol.h and diffbot_frames.py from protocol.yaml: `python firmware/generate.py`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

HERE = Path(__file__).parent
HEADER = HERE / "protocol.h"
MODULE = HERE.parent / "diffbotctl" / "links" / "diffbot_frames.py"
NOTICE = "Made from firmware/protocol.yaml by firmware/generate.py; change those."
TYPE_BITS = 4
CHECK_BYTES = 3

Frame = dict[str, Any]


def fields(frame: Frame) -> list[tuple[str, int, str, int]]:
    """Every field as (name, bits, meaning, how many); bits are negative when signed."""
    return [(name, spec[0], spec[1], spec[2] if len(spec) > 2 else 1)
            for name, spec in frame["fields"].items()]  # fmt: skip


def size(frame: Frame) -> int:
    """Payload length in bytes."""
    bits = TYPE_BITS + sum(abs(width) * many for _, width, _, many in fields(frame))
    if bits % 8:
        raise ValueError(f"{frame['help']}: {bits} bits are no whole bytes")
    return bits // 8


def wire(frame: Frame) -> int:
    """Bytes on the wire: payload, checksum, one COBS code, delimiter."""
    return size(frame) + CHECK_BYTES + 2


def header(protocol: dict[str, Any]) -> str:
    """The C header: constants, codes, structures, packing."""
    lines = [f"/* {NOTICE} */", "#ifndef PROTOCOL_H", "#define PROTOCOL_H", ""]
    lines += ["#include <stdint.h>", "", '#include "progmem.h"', ""]
    check = protocol["checksum"]
    lines.append(f"#define PROTOCOL_VERSION {protocol['version']}")
    lines.append(f"#define CHECK_POLYNOMIAL 0x{check['polynomial']:06X}UL")
    lines.append(f"#define CHECK_START 0x{check['start']:06X}UL")
    lines.append(f"#define CHECK_BYTES {CHECK_BYTES}")
    lines += [f"#define {name} {value}" for name, (value, _) in protocol["constants"].items()]
    longest = max(size(frame) for frame in protocol["frames"].values())
    lines += [f"#define PAYLOAD_LONGEST {longest}", ""]
    for group, codes in protocol["codes"].items():
        members = ", ".join(f"{group.upper()}_{code.upper()} = {spec[0]}"
                            for code, spec in codes.items())  # fmt: skip
        lines.append(f"enum {{ {members} }};")
    lines.append("")
    for name, frame in protocol["frames"].items():
        lines += _c_frame(name, frame)
    lines += _c_size(protocol["frames"])
    return "\n".join([*lines, "#endif", ""])


def _c_frame(name: str, frame: Frame) -> list[str]:
    """A packed structure that is the payload: gcc lays bit-fields from the lowest bit up."""
    lines = [f"/* {frame['help']} */", "typedef struct __attribute__((packed)) {"]
    lines.append("    uint8_t type : 4;")
    offset = TYPE_BITS
    for field, width, meaning, many in fields(frame):
        array = f"[{many}]" if many > 1 else ""
        whole = abs(width) in (8, 16, 32) and offset % 8 == 0
        bits = "" if whole else f" : {abs(width)}"
        lines.append(f"    {_c_type(width)} {field}{array}{bits}; /* {meaning} */")
        offset += abs(width) * many
    upper = name.upper()
    lines += [f"}} {name}_t;", f"enum {{ TYPE_{upper} = {frame['type']} }};"]
    check = f"sizeof({name}_t) == {size(frame)}"
    lines.append(f'_Static_assert({check}, "the structure is the payload");')
    if name == "settings":
        members = ", ".join(f"FIELD_{field.upper()}" for field, *_ in fields(frame))
        lines.append(f"enum {{ {members} }};")
    return [*lines, ""]


def _c_type(width: int) -> str:
    bits = next(size for size in (8, 16, 32) if abs(width) <= size)
    return f"int{bits}_t" if width < 0 else f"uint{bits}_t"


def _c_size(frames: dict[str, Frame]) -> list[str]:
    lines = ["/* Payload length of a type; 0 when there is no such type. */"]
    lines += ["static inline uint8_t payload_size(uint8_t type)", "{"]
    lines += ["    static const uint8_t sizes[16] PROGMEM = {"]
    lines += [f"        [TYPE_{name.upper()}] = sizeof({name}_t)," for name in frames]
    return [*lines, "    };", "    return pgm_read_byte(&sizes[type]);", "}", ""]


def module(protocol: dict[str, Any]) -> str:
    """The Python module: constants, codes, one NamedTuple a frame."""
    lines = [f'"""Frames of the protocol `diffbot`. {NOTICE}"""', "", "# fmt: off",
             "# ruff: noqa: E501", "from __future__ import annotations", "",
             "from typing import NamedTuple", ""]  # fmt: skip
    check = protocol["checksum"]
    lines.append(f"VERSION = {protocol['version']}")
    lines.append(f"CHECK_POLYNOMIAL = 0x{check['polynomial']:06X}")
    lines.append(f"CHECK_START = 0x{check['start']:06X}")
    lines += [
        f"{name} = {value}  # {help}" for name, (value, help) in protocol["constants"].items()
    ]
    for group, codes in protocol["codes"].items():
        members = ", ".join(f"{spec[0]}: {code!r}" for code, spec in codes.items())
        lines.append(f"{group.upper()} = {{{members}}}")
        meanings = ", ".join(f"{code!r}: {str(spec[1])!r}" for code, spec in codes.items())
        lines.append(f"{group.upper()}_MEANING = {{{meanings}}}")
    for name, frame in protocol["frames"].items():
        lines += _python_frame(name, frame)
    names = [_class(name) for name in protocol["frames"]]
    numbered = [(frame["type"], _class(name)) for name, frame in protocol["frames"].items()]
    lines += ["", "", f"Frame = {' | '.join(names)}"]
    lines.append("OF_TYPE: dict[int, type[Frame]] = "
                 f"{{{', '.join(f'{number}: {name}' for number, name in numbered)}}}")  # fmt: skip
    sizes = ", ".join(f"{_class(name)}: {wire(f)}" for name, f in protocol["frames"].items())
    lines.append(f"WIRE: dict[type[Frame], int] = {{{sizes}}}  # bytes on the wire")
    return "\n".join([*lines, ""])


def _class(name: str) -> str:
    return f"{name.capitalize()}Frame"


def _python_frame(name: str, frame: Frame) -> list[str]:
    lines = ["", "", f"class {_class(name)}(NamedTuple):", f'    """{frame["help"]}"""', ""]
    for field, _, meaning, many in fields(frame):
        kind = "tuple[int, ...]" if many > 1 else "int"
        lines.append(f"    {field}: {kind}  # {meaning}")
    lines += _python_pack(frame) + _python_unpack(name, frame)
    return lines


def _python_pack(frame: Frame) -> list[str]:
    terms = [str(frame["type"])]
    shift = TYPE_BITS
    for field, width, _, many in fields(frame):
        mask = (1 << abs(width)) - 1
        for index in range(many):
            source = f"self.{field}[{index}]" if many > 1 else f"self.{field}"
            terms.append(f"({source} & {mask}) << {shift}")
            shift += abs(width)
    return ["", "    def pack(self) -> bytes:", '        """Payload bytes."""', "        return (",
            "            " + "\n            | ".join(terms),
            f"        ).to_bytes({size(frame)}, 'little')"]  # fmt: skip


def _python_unpack(name: str, frame: Frame) -> list[str]:
    lines = ["", "    @classmethod",
             f"    def unpack(cls, payload: bytes) -> {_class(name)} | None:",
             '        """The frame in a payload of this type, or None when it is malformed."""',
             f"        if len(payload) != {size(frame)}:", "            return None",
             "        bits = int.from_bytes(payload, 'little')", "        return cls("]  # fmt: skip
    shift = TYPE_BITS
    for _field, width, _, many in fields(frame):
        each = []
        for _index in range(many):
            got = f"(bits >> {shift} & {(1 << abs(width)) - 1})"
            if width < 0:
                got = f"(({got} ^ {1 << (-width - 1)}) - {1 << (-width - 1)})"
            each.append(got)
            shift += abs(width)
        lines.append(f"            {'(' + ', '.join(each) + ')' if many > 1 else each[0]},")
    return [*lines, "        )"]


def load() -> dict[str, Any]:
    """The declaration, with every type number used once."""
    protocol: dict[str, Any] = yaml.safe_load((HERE / "protocol.yaml").read_text())
    types = [frame["type"] for frame in protocol["frames"].values()]
    if len(set(types)) != len(types) or not all(0 < number < 16 for number in types):
        raise ValueError("protocol.yaml: each frame needs its own type from 1 to 15")
    return protocol


def main() -> None:
    """Write both files."""
    protocol = load()
    HEADER.write_text(header(protocol))
    MODULE.write_text(module(protocol))
    for name, frame in protocol["frames"].items():
        print(f"{name:10} {size(frame):3} bytes of payload, {wire(frame):3} on the wire")


if __name__ == "__main__":
    main()

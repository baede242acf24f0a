"""Write protocol.h and diffbot_frames.py from protocol.yaml: `python firmware/generate.py`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

HERE = Path(__file__).parent
HEADER = HERE / "protocol.h"
MODULE = HERE.parent / "diffbotctl" / "links" / "diffbot_frames.py"
NOTICE = "Generated from firmware/protocol.yaml by firmware/generate.py: change those."
TYPE_BITS = 4
CHECK_BYTES = 3

Frame = dict[str, Any]


def fields(frame: Frame) -> list[tuple[str, int, str, int]]:
    """Fields as (name, bits, meaning, number of values); bits are negative when signed."""
    return [
        (name, spec[0], spec[1], spec[2] if len(spec) > 2 else 1)
        for name, spec in frame["fields"].items()
    ]


def size(frame: Frame) -> int:
    """Payload length in bytes."""
    bits = TYPE_BITS + sum(abs(width) * count for _, width, _, count in fields(frame))
    if bits % 8:
        raise ValueError(f"{frame['help']}: {bits} bits are not whole bytes")
    return bits // 8


def wire(frame: Frame) -> int:
    """Bytes on the wire: payload, checksum, one byte of COBS, delimiter."""
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
        members = ", ".join(
            f"{group.upper()}_{code.upper()} = {number}" for code, (number, _) in codes.items()
        )
        lines.append(f"enum {{ {members} }};")
    lines.append("")
    for name, frame in protocol["frames"].items():
        lines += _c_frame(name, frame)
    lines += _c_size(protocol["frames"])
    return "\n".join([*lines, "#endif", ""])


def _c_frame(name: str, frame: Frame) -> list[str]:
    """A packed structure that is the payload: gcc places bit-fields from the lowest bit up."""
    lines = [f"/* {frame['help']} */", "typedef struct __attribute__((packed)) {"]
    lines.append("    uint8_t type : 4;")
    offset = TYPE_BITS
    for field, width, meaning, count in fields(frame):
        array = f"[{count}]" if count > 1 else ""
        whole = abs(width) in (8, 16, 32) and offset % 8 == 0
        bits = "" if whole else f" : {abs(width)}"
        lines.append(f"    {_c_type(width)} {field}{array}{bits}; /* {meaning} */")
        offset += abs(width) * count
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
    lines = ["#ifndef __cplusplus /* C++ has no such initializer */"]
    lines += ["/* Payload length of a type; 0 when there is no such type. */"]
    lines += ["static inline uint8_t payload_size(uint8_t type)", "{"]
    lines += ["    static const uint8_t sizes[16] PROGMEM = {"]
    lines += [f"        [TYPE_{name.upper()}] = sizeof({name}_t)," for name in frames]
    return [*lines, "    };", "    return pgm_read_byte(&sizes[type]);", "}", "#endif", ""]


def module(protocol: dict[str, Any]) -> str:
    """The Python module: constants, an enumeration for each group of codes, a class for each frame.

    It is written as `ruff format` leaves it.
    """
    check = protocol["checksum"]
    names = {frame["type"]: _frame_class(name) for name, frame in protocol["frames"].items()}
    kinds = {
        (width, count)
        for frame in protocol["frames"].values()
        for _, width, _, count in fields(frame)
    }
    lines = [
        f'"""Frames of the protocol `diffbot`. {NOTICE}"""',
        "",
        "# ruff: noqa: E501",
        *["from enum import IntEnum", "from typing import Annotated, NamedTuple, Self", ""],
        f"VERSION = {protocol['version']}",
        f"CHECK_POLYNOMIAL = 0x{check['polynomial']:06X}",
        f"CHECK_START = 0x{check['start']:06X}",
        f"CHECK_BYTES = {CHECK_BYTES}",
        f"TYPE_BITS = {TYPE_BITS}",
        *[f"{name} = {value}  # {help}" for name, (value, help) in protocol["constants"].items()],
        "",
        "# Types of fields: bits on the wire, negative when signed; then the number of values.",
        *[_python_type(width, count) for width, count in sorted(kinds)],
        *["", "", CODE_CLASS.rstrip()],
    ]
    for group, codes in protocol["codes"].items():
        lines += _python_codes(group, codes)
    for name, frame in protocol["frames"].items():
        lines += _python_frame(name, frame)
    lines += ["", "", "Frame = (", *_alternatives(list(names.values())), ")"]
    lines += ["OF_TYPE: dict[int, type[Frame]] = {"]
    lines += [f"    {number}: {name}," for number, name in names.items()]
    return "\n".join([*lines, "}", ""])


CODE_CLASS = '''
class ProtocolCode(IntEnum):
    """A code of the protocol, with its meaning for a person."""

    meaning: str

    def __new__(cls, value: int, meaning: str = "") -> Self:
        """A member from its declaration."""
        code = int.__new__(cls, value)
        code._value_ = value
        code.meaning = meaning
        return code

    @classmethod
    def find(cls, value: int) -> Self | None:
        """The code with this number; None when this version does not know it."""
        return next((code for code in cls if code == value), None)
'''.lstrip()


def _frame_class(name: str) -> str:
    return f"{name.capitalize()}Frame"


def _type_name(width: int, count: int) -> str:
    return f"{'Int' if width < 0 else 'Uint'}{abs(width)}" + (f"x{count}" if count > 1 else "")


def _python_type(width: int, count: int) -> str:
    value = f"tuple[int, ...], {width}, {count}" if count > 1 else f"int, {width}"
    return f"{_type_name(width, count)} = Annotated[{value}]"


def _alternatives(names: list[str]) -> list[str]:
    return [f"    {'| ' if index else ''}{name}" for index, name in enumerate(names)]


def _python_codes(group: str, codes: dict[str, Any]) -> list[str]:
    lines = ["", "", f"class {group.capitalize()}Code(ProtocolCode):"]
    lines += [f'    """Codes of `{group}`."""', ""]
    for code, (number, meaning) in codes.items():
        value = f'{number}, "{meaning}"' if meaning else f"{number}"
        lines.append(f"    {code.upper()} = {value}")
    return lines


def _python_frame(name: str, frame: Frame) -> list[str]:
    help = frame["help"]
    lines = ["", "", f"class {_frame_class(name)}(NamedTuple):"]
    lines += [f'    """{help[0].upper()}{help[1:]}."""', ""]
    for field, width, meaning, count in fields(frame):
        lines.append(f"    {field}: {_type_name(width, count)}  # {meaning}")
    return lines


def load() -> dict[str, Any]:
    """The declaration. Raises ValueError when a type number is used twice."""
    protocol: dict[str, Any] = yaml.safe_load((HERE / "protocol.yaml").read_text())
    types = [frame["type"] for frame in protocol["frames"].values()]
    if len(set(types)) != len(types) or not all(0 < number < 16 for number in types):
        raise ValueError("protocol.yaml: each frame needs its own type from 1 to 15")
    return protocol


def main() -> None:
    """Write both files; print the sizes of all frames."""
    protocol = load()
    HEADER.write_text(header(protocol))
    MODULE.write_text(module(protocol))
    for name, frame in protocol["frames"].items():
        print(f"{name:10} {size(frame):3} bytes of payload, {wire(frame):3} on the wire")


if __name__ == "__main__":
    main()

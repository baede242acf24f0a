"""Build the ROS 2 package tf2_msgs into a virtual environment that has rclpy.

    python build_tf2_msgs.py

The wheels of ROS 2 contain no tf2_msgs. Its message is one list of transforms; the generators that
come with rclpy write its code, and the compiler builds it. Nodes of other machines accept it: the
hash of its type depends on the definition alone.

Run with the Python of that environment; needs g++ and the headers of that Python.
"""

import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from importlib.metadata import entry_points
from pathlib import Path

import numpy

PACKAGE = "tf2_msgs"
DEFINITION = "geometry_msgs/TransformStamped[] transforms\n"
PREFIX = Path(sys.prefix)
SITE = Path(sysconfig.get_paths()["purelib"])
C_FLAGS = ("-O1", "-fPIC", "-w", "-shared")
GENERATOR, DISPATCH = "rosidl_generator_c", "rosidl_typesupport_c"
FAST_DDS, INTROSPECTION = "rosidl_typesupport_fastrtps_c", "rosidl_typesupport_introspection_c"
# Library, its folder of generated sources, and the libraries of this package that it needs.
LIBRARIES = (
    (GENERATOR, "c", ("detail/*.c",), ()),
    (FAST_DDS, "fastrtps_c", ("detail/*.cpp",), (GENERATOR,)),
    (INTROSPECTION, "introspection_c", ("detail/*.c",), (GENERATOR,)),
    (DISPATCH, "c", ("*.cpp",), (GENERATOR,)),
)
DEPENDENCIES = ("geometry_msgs", "std_msgs", "builtin_interfaces")
RUNTIME = (
    "rosidl_runtime_c",
    "rosidl_typesupport_c",
    "rosidl_typesupport_fastrtps_c",
    "rosidl_typesupport_fastrtps_cpp",
    "rosidl_typesupport_introspection_c",
    "rcutils",
    "rcpputils",
    "fastcdr",
    "rmw",
)


def drop_doubled_metadata() -> None:
    """Remove metadata that a wheel holds twice: each generator would be found, and run, twice."""
    groups = entry_points(group="rosidl_cli.command.generate.type_extensions")
    if len({entry.name for entry in groups}) < len(list(groups)):
        for path in SITE.glob("rosidl_*.egg-info"):
            shutil.rmtree(path)


def generate(folder: Path) -> None:
    """Write the code of the package into `folder`."""
    (folder / "msg").mkdir()
    (folder / "msg" / "TFMessage.msg").write_text(DEFINITION)
    kinds = ["-t", "py", "-t", "c", "-t", "cpp"]
    for support in ("c", "fastrtps_c", "fastrtps_cpp", "introspection_c"):
        kinds += ["-ts", support]
    command = [PREFIX / "bin" / "rosidl", "generate", "-o", "out", *kinds]
    subprocess.run(
        [*command, "-I", PREFIX / "share", PACKAGE, "msg/TFMessage.msg"],
        cwd=folder,
        env={**os.environ, "AMENT_PREFIX_PATH": str(PREFIX)},
        check=True,
        stdout=subprocess.DEVNULL,
    )


def include_options(folder: Path) -> list[str]:
    """Folders of headers: generated ones below `folder`, and those of the environment."""
    include = PREFIX / "include"
    python = sysconfig.get_paths()["include"]
    options = [f"-I{path}" for path in (folder / "include", include, python, numpy.get_include())]
    return options + [f"-I{path}" for path in sorted(include.iterdir()) if path.is_dir()]


def arrange_headers(folder: Path) -> None:
    """Join the generated folders to one folder `tf2_msgs`, as their #include lines expect."""
    for kind in ("c", "cpp", "fastrtps_c", "fastrtps_cpp", "introspection_c"):
        source = folder / "out" / kind
        shutil.copytree(source, folder / "include" / PACKAGE, dirs_exist_ok=True)


def compile_library(output: Path, sources: list[Path], options: list[str]) -> None:
    """Compile and link one shared library."""
    command = ["g++", *C_FLAGS, "-o", output, f"-L{PREFIX / 'lib'}", f"-Wl,-rpath,{PREFIX / 'lib'}"]
    c_sources = [path for path in sources if path.suffix == ".c"]
    for path in c_sources:  # g++ would compile them as C++
        subprocess.run(["gcc", *C_FLAGS[:-1], "-c", path, *options, "-o", f"{path}.o"], check=True)
    objects = [Path(f"{path}.o") for path in c_sources]
    others = [path for path in sources if path.suffix != ".c"]
    subprocess.run([*command, *objects, *others, *options], check=True)


def found_libraries() -> list[str]:
    """Options that link the runtime and the packages that the message refers to."""
    names = [*RUNTIME]
    for package in DEPENDENCIES:
        names += [f"{package}__{kind}" for kind, *_ in LIBRARIES]
        names.append(f"{package}__rosidl_generator_py")
    lib = PREFIX / "lib"
    return [f"-l{name}" for name in names if (lib / f"lib{name}.so").exists()]


def build(folder: Path) -> None:
    """Compile the generated code of `folder` and install it."""
    arrange_headers(folder)
    options = [*include_options(folder), *found_libraries(), "-Wl,--unresolved-symbols=ignore-all"]
    lib = PREFIX / "lib"
    for kind, source, patterns, needed in LIBRARIES:
        sources = [
            path
            for pattern in patterns
            for path in sorted((folder / "out" / source / "msg").glob(pattern))
        ]
        own = [f"-l{PACKAGE}__{name}" for name in needed]
        compile_library(lib / f"lib{PACKAGE}__{kind}.so", sources, [*own, *options])
    python = folder / "out" / "py"
    own = [f"-l{PACKAGE}__{kind}" for kind, *_ in LIBRARIES]
    converter = f"{PACKAGE}__rosidl_generator_py"
    compile_library(
        lib / f"lib{converter}.so", sorted((python / "msg").glob("*_s.c")), [*own, *options]
    )
    package = SITE / PACKAGE
    shutil.rmtree(package, ignore_errors=True)
    shutil.copytree(python, package, ignore=shutil.ignore_patterns("tmp", "*.c", "*.o"))
    (package / "__init__.py").touch()
    for kind in (DISPATCH, FAST_DDS, INTROSPECTION):
        source = python / f"_{PACKAGE}_s.ep.{kind}.c"
        output = package / f"{PACKAGE}_s__{kind}.so"
        compile_library(output, [source], [f"-l{converter}", *own, *options])


def main() -> None:
    drop_doubled_metadata()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        generate(folder)
        build(folder)


main()

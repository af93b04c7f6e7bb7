#!/usr/bin/env python3
"""Lay out the OpenImageIO that Sanguine links to: include/, lib/, fonts/, licenses/, on Windows bin/ too.

The official wheel carries the shared libraries, needs only libc, libstdc++ and
zlib (on Linux), and exports their C++ symbols; the headers are in the source archive of
the same version. Debian's own package would drag some 260 libraries into the
extension. pip checks both files against the hashes in
requirements-openimageio.txt.

macOS and Windows are written and UNTESTED (docs/releasing.md). The wheel for
Windows has DLLs without the import libraries of the two that we link to: they
are made of the DLLs' tables of exports (pefile reads them, llvm-lib writes).

Usage: fetch_openimageio.py DESTINATION
"""

import platform
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from pathlib import Path

REQUIREMENT = Path(__file__).with_name("requirements-openimageio.txt")

# Names the people on a contact sheet.
CAPTION_FONT = "DroidSans.ttf"

# (sys.platform, machine) -> pip's name of the platform.
WHEELS = {
    ("linux", "x86_64"): "manylinux_2_28_x86_64",
    ("darwin", "arm64"): "macosx_11_0_arm64",
    ("darwin", "x86_64"): "macosx_10_15_x86_64",
    ("win32", "AMD64"): "win_amd64",
}
LINKED = ("OpenImageIO", "OpenImageIO_Util")

# Headers that OpenImageIO's build would have made: it forwards to the system's
# fmt in the same way when that is not copied in.
FMT_HEADERS = ("args.h", "format.h", "ostream.h", "printf.h")


def download(kind: str, target: Path) -> Path:
    """Fetch one pinned file; `kind` is pip's --only-binary or --no-binary."""
    command = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--no-build-isolation"]
    command += [kind, ":all:", "--require-hashes", "--requirement", str(REQUIREMENT), "--dest", str(target)]
    if kind == "--only-binary":  # the libraries do not depend on Python: one wheel serves every version
        command += ["--python-version", "3.11", "--implementation", "cp", "--platform", WHEELS[sys.platform, platform.machine()]]
    subprocess.run(command, check=True)
    (result,) = target.glob("*.whl" if kind == "--only-binary" else "*.tar.gz")
    return result


def version_header(template: str, version: str) -> str:
    """What CMake's configure_file makes of oiioversion.h.in for the official wheel."""
    major, minor, patch, tweak = version.split(".")
    values = {
        "PROJECT_VERSION_MAJOR": major,
        "PROJECT_VERSION_MINOR": minor,
        "PROJECT_VERSION_PATCH": patch,
        "PROJECT_VERSION_TWEAK": tweak,
        "PROJECT_VERSION_RELEASE_TYPE": "",
        "OIIO_USE_COMPILED_FMT_VALUE": "0",
        "PROJ_NAMESPACE": "OpenImageIO",
        "PROJ_VERSION_NAMESPACE": f"v{major}_{minor}",
        "Imath_VERSION_MAJOR": "3",
        "Imath_VERSION_MINOR": "2",
        "CMAKE_CXX_STANDARD": "17",
    }
    text = template.replace("#cmakedefine01 OIIO_TBB", "#define OIIO_TBB 0")
    return re.sub(r"@(\w+)@", lambda match: values[match[1]], text)


def destination_folder(member: Path) -> str | None:
    """Where a file of the wheel goes; None for those that are not needed."""
    if ".so." in member.name or member.suffix == ".dylib":
        return "lib"
    if member.suffix == ".dll":
        return "bin"
    if member.name == CAPTION_FONT:
        return "fonts"
    if member.parent.name == "licenses":
        return "licenses"
    return None


def lay_out(wheel: Path, sdist: Path, root: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        for member in map(Path, archive.namelist()):
            if folder := destination_folder(member):
                target = root / folder / member.name
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(archive.read(str(member)))

    version = re.search(r"openimageio-([\d.]+)\.tar\.gz", sdist.name)[1]
    prefix = f"openimageio-{version}/src/include/"
    include = root / "include"
    with tarfile.open(sdist) as archive:
        for member in archive.getmembers():
            if member.isfile() and member.name.startswith(prefix + "OpenImageIO/"):
                target = include / member.name.removeprefix(prefix)
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(archive.extractfile(member).read())

    headers = include / "OpenImageIO"
    template = headers / "oiioversion.h.in"
    (headers / "oiioversion.h").write_text(version_header(template.read_text(), version))
    (headers / "detail" / "fmt").mkdir()
    for name in FMT_HEADERS:
        (headers / "detail" / "fmt" / name).write_text(f"#include <fmt/{name}>\n")


def make_import_libraries(root: Path) -> None:
    """lib/NAME.lib for bin/NAME.dll, for each NAME that we link to."""
    import pefile

    (root / "lib").mkdir(exist_ok=True)
    for name in LINKED:
        library = pefile.PE(str(root / f"bin/{name}.dll"), fast_load=True)
        library.parse_data_directories([pefile.DIRECTORY_ENTRY["IMAGE_DIRECTORY_ENTRY_EXPORT"]])
        symbols = [symbol.name.decode() for symbol in library.DIRECTORY_ENTRY_EXPORT.symbols if symbol.name]
        listed = root / f"lib/{name}.def"
        listed.write_text("\n".join([f"LIBRARY {name}.dll", "EXPORTS", *(f"    {symbol}" for symbol in symbols), ""]))
        command = ["llvm-lib", f"/def:{listed}", "/machine:x64", f"/out:{root / f'lib/{name}.lib'}"]
        subprocess.run(command, check=True)


def main() -> None:
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    destination = Path(sys.argv[1])
    destination.parent.mkdir(parents=True, exist_ok=True)
    # Built beside the destination and renamed, so that a broken download leaves nothing half done.
    with tempfile.TemporaryDirectory(dir=destination.parent) as scratch:
        root = Path(scratch) / "root"
        root.mkdir()
        lay_out(
            download("--only-binary", Path(scratch) / "wheel"),
            download("--no-binary", Path(scratch) / "sdist"),
            root,
        )
        if sys.platform == "win32":
            make_import_libraries(root)
        shutil.rmtree(destination, ignore_errors=True)
        root.rename(destination)
    print(f"OpenImageIO is in {destination}")


if __name__ == "__main__":
    main()

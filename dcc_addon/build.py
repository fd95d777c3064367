# SPDX-License-Identifier: GPL-3.0-or-later
"""Build the Blender extension: `python dcc_addon/build.py [--platform linux-x64] [-o dist]`.

One zip per platform with the wheels for the Python of every supported Blender, so that Blender installs them without
network. For Blender before 4.2, a zip with everything unpacked in a folder.
"""

import argparse
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
PLATFORMS = {
    "linux-x64": ["manylinux_2_28_x86_64", "manylinux_2_27_x86_64", "manylinux2014_x86_64", "manylinux_2_17_x86_64"],
    "windows-x64": ["win_amd64"],
    "macos-arm64": ["macosx_14_0_arm64", "macosx_11_0_arm64", "macosx_10_15_universal2"],
    "macos-x64": ["macosx_13_0_x86_64", "macosx_10_13_x86_64", "macosx_10_15_universal2"],
}
PYTHONS = ("3.11", "3.13")
"""Of Blender 4.2 to 5.0, and of 5.1 and later."""
PINNED = ("onnxruntime", "usd-core")
"""Packages that are included in the versions of `constraints.txt`. numpy is Blender's own; see LEGACY_TOO."""
HELD_BACK = {"scipy": "1.15.3"}
"""The newest that runs on the numpy 1.24 of Blender 4.2 and has wheels for both Pythons."""
OLDER = {"macos-x64": {"onnxruntime": "1.23.2"}, "windows-x64": {"onnxruntime": "1.20.1"}}
"""The last version with wheels for Intel Macs, which on Linux gives the same points as the newest, bit for bit; and the last that
starts with the C++ runtime that Blender 4.2 to 5.0 ship on Windows (14.29: later ones need 14.40), 0.05 mm off at most.
"""
BLENDERS_OWN = {"windows-x64": ("usd-core",)}
"""What is left to Blender, which has it, too: Windows would confuse Blender's usd_ms.dll with that of usd-core, which has the same
name."""
ENDED = {"macos-x64": ("3.13",)}
"""Pythons that no Blender of a platform has: the last for Intel Macs is 4.5 LTS."""
LEGACY = ("linux-x64", "3.11")
"""What the zip for Blender before 4.2 is built for: Linux distributions, which still carry it."""
LEGACY_TOO = ("numpy",)
"""What the legacy zip also has: Debian's Blender comes without numpy. If there is one, it is found first."""
NOT_SHIPPED = ("build.py", "blender_manifest.toml", "__pycache__")


def main() -> int:
    """Build what is asked for; prints each file made."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--platform", choices=[*PLATFORMS, "all"], default="all")
    parser.add_argument("--python", choices=PYTHONS, action="append", help="default: all")
    parser.add_argument("--no-legacy", action="store_true", help="leave out the zip for Blender before 4.2")
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "dist")
    parser.add_argument(
        "--cache", type=Path, default=ROOT / "build" / "wheels", help="where downloaded wheels are kept"
    )
    args = parser.parse_args()
    args.output.mkdir(parents=True, exist_ok=True)
    pythons = args.python or PYTHONS
    own, versions = own_wheel(args.cache / "own"), compiled()
    for platform in PLATFORMS if args.platform == "all" else [args.platform]:
        wheels = [own]
        for python in [p for p in pythons if p not in ENDED.get(platform, ())]:
            wheels += download(args.cache / platform / python, versions, platform, python)
        print(extension(args.output, platform, wheels))
    if not args.no_legacy:
        platform, python = LEGACY
        versions = compiled((*PINNED, *LEGACY_TOO))
        wheels = [own, *download(args.cache / platform / python, versions, platform, python)]
        print(legacy(args.output, wheels))
    return 0


def own_wheel(folder: Path) -> Path:
    """The wheel of `neuralocks_core` and `usd`."""
    shutil.rmtree(folder, ignore_errors=True)
    pip("wheel", "--no-deps", "--no-build-isolation", "-w", str(folder), str(ROOT))
    return next(folder.glob("neuralocks-*.whl"))


def compiled(pinned: Sequence[str] = PINNED) -> dict[str, str]:
    """Package -> version of what is included; for those `pinned`, the version in the constraints."""
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pins = dict(line.split("==") for line in lines if "==" in line)
    return {name: pins[name] for name in pinned} | HELD_BACK


def download(folder: Path, versions: dict[str, str], platform: str, python: str) -> list[Path]:
    """Wheels of these packages, fetched once."""
    folder.mkdir(parents=True, exist_ok=True)
    found = []
    for name, version in versions.items():
        if name in BLENDERS_OWN.get(platform, ()):
            continue
        version = OLDER.get(platform, {}).get(name, version)
        pattern = f"{name.replace('-', '_')}-{version}-*.whl"
        if not list(folder.glob(pattern)):
            tags = [t for tag in PLATFORMS[platform] for t in ("--platform", tag)] + ["--python-version", python]
            pip("download", "--no-deps", "--only-binary", ":all:", *tags, "-d", str(folder), f"{name}=={version}")
        found.append(next(folder.glob(pattern)))
    return found


def extension(output: Path, platform: str, wheels: list[Path]) -> Path:
    """The zip that Blender 4.2 and later installs."""
    lines = [f'platforms = ["{platform}"]', "wheels = ["]
    lines += [f'  "./wheels/{wheel.name}",' for wheel in sorted(wheels)] + ["]", ""]
    manifest = (HERE / "blender_manifest.toml").read_text(encoding="utf-8")
    # Top-level keys must come before the first table.
    head, table, tail = manifest.partition("[permissions]")
    out = output / f"neuralocks-{version(manifest)}-{platform}.zip"
    with written(out) as archive:
        archive.writestr("blender_manifest.toml", head + "\n".join(lines) + "\n" + table + tail)
        for path in sources():
            archive.write(path, path.relative_to(HERE).as_posix())
        for wheel in sorted(wheels):
            archive.write(wheel, f"wheels/{wheel.name}", compress_type=zipfile.ZIP_STORED)
    return out


def legacy(output: Path, wheels: list[Path]) -> Path:
    """The zip for Blender before 4.2: a folder with the packages unpacked in it, and the first wheel, our own, as a file."""
    manifest = (HERE / "blender_manifest.toml").read_text(encoding="utf-8")
    out = output / f"neuralocks-{version(manifest)}-legacy-{LEGACY[0]}.zip"
    with written(out) as archive:
        for path in sources():
            archive.write(path, f"neuralocks/{path.relative_to(HERE).as_posix()}")
        own = wheels[0]  # for the Python that trains
        archive.write(own, f"neuralocks/wheels/{own.name}", compress_type=zipfile.ZIP_STORED)
        for wheel in sorted(wheels):
            with zipfile.ZipFile(wheel) as packed:
                for name in packed.namelist():
                    if not name.endswith("/") and "/tests/" not in name:
                        archive.writestr(f"neuralocks/packages/{name}", packed.read(name))
    return out


def sources() -> list[Path]:
    """Files of the add-on itself; the manifest is written with the wheels in it."""
    files = (path for path in sorted(HERE.rglob("*")) if path.is_file() and path.suffix != ".pyc")
    return [path for path in files if not set(path.relative_to(HERE).parts) & set(NOT_SHIPPED)]


def version(manifest: str) -> str:
    """The version that the manifest gives."""
    line = next(line for line in manifest.splitlines() if line.startswith("version"))
    return line.split('"')[1]


def pip(*arguments: str) -> None:
    """Run pip of this Python."""
    subprocess.run([sys.executable, "-m", "pip", "--disable-pip-version-check", "-q", *arguments], check=True)


@contextmanager
def written(path: Path) -> Iterator[zipfile.ZipFile]:
    """A zip that appears under its name only when it is complete."""
    with tempfile.TemporaryDirectory(prefix=".zip-", dir=path.parent, ignore_cleanup_errors=True) as folder:
        part = Path(folder) / path.name
        with zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED, compresslevel=6) as archive:
            yield archive
        part.replace(path)


if __name__ == "__main__":
    sys.exit(main())

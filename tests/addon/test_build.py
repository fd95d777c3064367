# SPDX-License-Identifier: GPL-3.0-or-later
"""What is in the zips and the wheel that Blender installs."""

import json
import zipfile

from dcc_addon import build
from neuralocks_core.models import model_file
from neuralocks_core.native.build import TARGETS
from neuralocks_core.native.library import file_for


def test_the_wheel_holds_the_packages_the_models_and_the_licences(tmp_path):
    """Built as `make addon` builds it, with what the tests' environment holds."""
    with zipfile.ZipFile(build.own_wheel(tmp_path / "own")) as made:
        listed = set(made.namelist())
    models = {path.name for path in (model_file.shipped(), *model_file.specialists(), model_file.shipped("rig"))}
    shipped = models | {"shot/shot.usda"}
    assert {f"neuralocks_core/shipped/{name}" for name in shipped} <= listed
    assert {"usd/cli/app.py", "neuralocks_core/rig/hair.h.in"} <= listed
    assert {f"neuralocks_core/native/libraries/{file_for(target).name}" for target in TARGETS} <= listed
    assert {name.split("/licenses/")[1] for name in listed if "/licenses/" in name} == {"LICENSE", "CREDITS.md"}
    assert {name.split("/")[0].split("-")[0] for name in listed} == {"neuralocks_core", "usd", "neuralocks"}
    assert not any("__pycache__" in name for name in listed)


def test_wheels_are_those_that_the_tests_pass_with():
    """Except what Blender's own numpy requires."""
    kept, own = (build.ROOT / "constraints.txt").read_text("utf-8").split(), build.compiled()
    assert {f"{name}=={version}" for name, version in own.items()} - set(kept) == {f"scipy=={build.HELD_BACK['scipy']}"}


def test_zips_hold_what_blender_expects(tmp_path):
    """The manifest lists the wheels that are in the zip, and the legacy zip has one folder with the packages in it."""
    import tomllib

    wheel = tmp_path / "thing-1.0-py3-none-any.whl"
    with zipfile.ZipFile(wheel, "w") as made:
        made.writestr("thing/__init__.py", "")
    with zipfile.ZipFile(build.extension(tmp_path, "linux-x64", [wheel])) as made:
        manifest = tomllib.loads(made.read("blender_manifest.toml").decode())
        listed = set(made.namelist())
    assert manifest["platforms"] == ["linux-x64"] and manifest["permissions"]
    assert all(w.removeprefix("./") in listed for w in manifest["wheels"])
    assert {"__init__.py", "LICENSE", "services/hair/live.py"} <= listed
    assert not any("build.py" in n or "__pycache__" in n for n in listed)
    with zipfile.ZipFile(build.legacy(tmp_path, [wheel])) as made:
        listed = made.namelist()
    assert all(n.startswith("neuralocks/") for n in listed) and "neuralocks/packages/thing/__init__.py" in listed
    assert f"neuralocks/wheels/{wheel.name}" in listed
    assert json.dumps(manifest["version"]) == json.dumps(
        build.version((build.HERE / "blender_manifest.toml").read_text())
    )


def test_the_legacy_zip_brings_numpy(tmp_path, monkeypatch):
    """Debian's Blender has none; the others have their own."""
    made = {}
    monkeypatch.setattr(build, "own_wheel", lambda _: "own")
    monkeypatch.setattr(build, "download", lambda folder, versions, *_: list(versions))
    monkeypatch.setattr(build, "extension", lambda *given: made.setdefault("extension", given[-1]))
    monkeypatch.setattr(build, "legacy", lambda *given: made.setdefault("legacy", given[-1]))
    monkeypatch.setattr("sys.argv", ["build.py", "--platform", "linux-x64", "-o", str(tmp_path / "out")])
    assert build.main() == 0
    assert set(made["legacy"]) - set(made["extension"]) == {"numpy"}


def test_windows_gets_what_runs_beside_blenders_own_libraries(tmp_path, monkeypatch):
    """Blender's usd_ms.dll and C++ runtime are loaded before ours would be."""

    def fetch(*arguments):
        name, _, version = arguments[-1].partition("==")
        folder = tmp_path / arguments[arguments.index("-d") + 1]
        (folder / f"{name.replace('-', '_')}-{version}-cp311-none-{arguments[5]}.whl").touch()

    monkeypatch.setattr(build, "pip", fetch)
    versions = build.compiled()
    for platform in ("linux-x64", "windows-x64"):
        got = {
            wheel.name.split("-")[0]: wheel.name.split("-")[1]
            for wheel in build.download(tmp_path / platform, versions, platform, "3.11")
        }
        windows = platform == "windows-x64"
        assert ("usd_core" in got) != windows and set(got) >= {"onnxruntime", "scipy"}
        assert (got["onnxruntime"] == "1.20.1") == windows

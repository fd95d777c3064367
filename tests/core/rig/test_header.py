# SPDX-License-Identifier: Apache-2.0
"""The header for engines: compiles everywhere, and gives the network's turns whatever it is fed and its joints are called."""

import re
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rig import rig_spec
from neuralocks_core.rig.export_c import example_beside, export_c
from neuralocks_core.rig.network import held_features
from neuralocks_core.rotation import from_quaternion
from tests.core.rig.builders import model_of, random_features, random_model
from tests.core.rig.c_programs import COMPILERS, INPUT_HARNESS, compiled, run_c

HARNESS = """#include "hair.h"
#include <stdio.h>
int main(void) {
  static float x[NL_HAIR_FEATURES];
  static nl_hair_output out;
  while (fread(x, sizeof(float), NL_HAIR_FEATURES, stdin) == NL_HAIR_FEATURES) {
    nl_hair_turns(x, &out);
    fwrite(&out, sizeof out, 1, stdout);
  }
  return 0;
}
"""

EVALUATE_HARNESS = """#include "hair.h"
#include <stdio.h>
int main(void) {
  static nl_hair_input in;
  static nl_hair_output out;
  while (fread(&in, sizeof in, 1, stdin) == 1) {
    nl_hair_evaluate(&in, &out);
    fwrite(&out, sizeof out, 1, stdout);
  }
  return 0;
}
"""


@pytest.mark.parametrize(
    ("kind", "compiler"),
    [("static", COMPILERS[0]), ("odd", COMPILERS[0]), *(("shipped", c) for c in COMPILERS)],
    ids=str,
)
def test_c_agrees_with_numpy(tmp_path, kind, compiler):
    """Within 1e-6 on 10,000 random inputs, as plain C and C++ and with everything that the machine can do."""
    model = model_of(kind)
    features = random_features(model, 10_000)
    ours = model.evaluate(features)
    export_c(model, tmp_path / "hair.h")
    for options in (("-O2",), ("-O3", "-march=native")):
        c = run_c(compiled(tmp_path, HARNESS, options, compiler), features, ours[0].size).reshape(ours.shape)
        assert np.abs(c - ours).max() < 1e-6


@pytest.mark.parametrize("compiler", COMPILERS, ids=lambda c: c[0])
@pytest.mark.parametrize("dynamic", [False, True])
def test_header_and_example_compile_without_a_warning(tmp_path, compiler, dynamic):
    """As C99 and as C++; the worked example runs."""
    export_c(random_model(spec=rig_spec(dynamic)), tmp_path / "hair.h")
    source = (tmp_path / "hair_example.c").read_text()
    for options in (("-O0",), ("-O3", "-march=native")):
        program = compiled(tmp_path, source, options, compiler)
        assert "hair_0_1 turns by" in subprocess.run([program], capture_output=True, text=True, check=True).stdout
    told = next(line.strip(" *").split(" && ")[0] for line in source.splitlines() if " cc " in line).split()
    subprocess.run([compiler[0], "-x", compiler[1], *told[2:]], cwd=tmp_path, check=True)  # as its comment says


def test_two_models_under_one_prefix_do_not_compile(tmp_path):
    """One would move the other's hair; the same header twice is fine, and so is another prefix."""
    first, second = (random_model((4,) * 2, 8, seed, rig_spec()) for seed in (0, 1))
    export_c(first, tmp_path / "first.h")
    export_c(second, tmp_path / "second.h")
    export_c(second, tmp_path / "other.h", prefix="other")
    source = '#include "first.h"\n#include "first.h"\n#include "%s"\nint main(void) { return 0; }\n'
    compiled(tmp_path, source % "other.h", ("-Wno-unused-function",))
    (tmp_path / "both.c").write_text(source % "second.h")
    done = subprocess.run(["gcc", "-fsyntax-only", "both.c"], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode and "--prefix" in done.stderr


def test_nobodys_own_file_is_written_over(tmp_path):
    (tmp_path / "hair_example.c").write_text("int mine;\n")
    with pytest.raises(NeuralocksError, match="hair_example.c: would be overwritten by the worked example"):
        export_c(random_model(), tmp_path / "hair.h")
    assert [file.name for file in tmp_path.iterdir()] == ["hair_example.c"]
    (tmp_path / "hair_example.c").rename(tmp_path / "hair.h")
    with pytest.raises(NeuralocksError, match="hair.h: would be overwritten by the header"):
        export_c(random_model(), tmp_path / "hair.h")
    assert [file.read_text() for file in tmp_path.iterdir()] == ["int mine;\n"]
    for name in ('my "hair".h', "hair\udcff.h"):
        with pytest.raises(NeuralocksError, match="no #include or compiler can name it"):
            export_c(random_model(), tmp_path / name)
    with pytest.raises(NeuralocksError, match="a dash in front"):
        export_c(random_model(), tmp_path / "-hair.h")


@pytest.mark.skipif(not shutil.which("cc"), reason="no cc here")
@pytest.mark.parametrize("name", ["braid.h", "long hair (1).h", "braid.hpp"])
def test_the_example_is_built_by_the_line_that_it_gives(tmp_path, name):
    export_c(random_model(), tmp_path / name)
    command = re.search(r"(cc -std=c99|c\+\+ -std=c\+\+11) .*", example_beside(tmp_path / name).read_text())[0]
    done = subprocess.run(command, shell=True, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0 and "turns by" in done.stdout, done.stderr


def test_anything_gives_a_bounded_unit_quaternion(tmp_path):
    """Huge, tiny and infinite numbers and NaN, in C and in numpy."""
    model = random_model()
    export_c(model, tmp_path / "hair.h")
    rng = np.random.default_rng(0)
    sizes = [0, 1e-38, 1, 1e10, 3.4e38, np.inf, np.nan]
    wild = (rng.choice(sizes, (500, 15)) * rng.choice([-1, 1], (500, 15))).astype(np.float32)
    c = run_c(compiled(tmp_path, HARNESS), wild, 16 * 4).reshape(500, 16, 4)
    for turns in (c, model.evaluate(wild)):
        assert np.abs(np.linalg.norm(turns, axis=-1) - 1).max() < 1e-5
        assert turns[..., 0].min() > np.cos(model.max_angle / 2) - 1e-5
    raw = np.full((1, 27 - 12), 3.4e38, np.float32)
    inputs = run_c(compiled(tmp_path, INPUT_HARNESS), raw, 15)
    assert np.isfinite(run_c(compiled(tmp_path, HARNESS), inputs, 64)).all()


@pytest.mark.parametrize("dynamic", [False, True])
def test_all_in_one_is_the_network_on_the_features(tmp_path, dynamic):
    """Also of inputs that are too large, infinite and NaN, of which the features are within the model's limits."""
    model = random_model(spec=rig_spec(dynamic))
    export_c(model, tmp_path / "hair.h")
    rng = np.random.default_rng(0)
    rows = rng.normal(size=(1000, model.inputs)).astype(np.float32)
    wild = rng.random(rows.shape) < 0.1
    wild[:500] = False
    rows[wild] = rng.choice([1e10, -3e38, np.inf, -np.inf, np.nan], wild.sum())
    together = run_c(compiled(tmp_path, EVALUATE_HARNESS), rows, 64).reshape(1000, 16, 4)
    features = run_c(compiled(tmp_path, INPUT_HARNESS), rows, model.inputs)
    assert (np.abs(features) <= model.limits).all()
    assert np.abs(together - model.evaluate(features)).max() < 1e-6


def test_the_header_needs_no_library(tmp_path):
    export_c(random_model(spec=rig_spec(True)), tmp_path / "hair.h")
    assert "#include" not in (tmp_path / "hair.h").read_text()


def test_features_from_quaternions(tmp_path):
    """The header's own features are those that training and baking use, of quaternions of any length that it says; zero turns nothing."""
    model = random_model()
    export_c(model, tmp_path / "hair.h")
    rng = np.random.default_rng(3)
    q = rng.normal(size=(200, 3, 4))
    q /= np.linalg.norm(q, axis=-1, keepdims=True)
    q[range(2, 5), range(3)] = 1, 0, 0, 0
    down = np.tile([0.0, -1.0, 0.0], (200, 1))
    head, neck, chest = np.moveaxis(from_quaternion(q), 1, 0)
    relative = np.swapaxes(head, -1, -2)[:, None] @ np.stack([neck, chest], axis=1)
    wanted = held_features(model.spec, relative, np.einsum("nji,nj->ni", head, down))
    lengths = re.search(r"any length from (\S+) to (\S+)", (tmp_path / "hair.h").read_text()).groups()
    sizes = np.exp(rng.uniform(*np.log(np.array(lengths, float)), (200, 3, 1)))
    sizes[:2] = np.array(lengths, float)[:, None, None]
    q *= sizes
    q[range(2, 5), range(3)] = 0
    rows = np.concatenate([q.reshape(200, 12), down], axis=1)
    assert np.abs(run_c(compiled(tmp_path, INPUT_HARNESS), rows, 15) - wanted).max() < 2e-6


def test_names_of_any_alphabet_stay_apart_in_the_header(tmp_path):
    """Joint names are UTF-8 in C; nothing in a name, whoever made the model, escapes its literal or comment."""
    names = ["左髪", "右髪", 'a"b\\', "*/ int x; /*", "**//", "t??/", "n\nl"]
    model = random_model((1,) * len(names))
    reads = {"head": "*/ int y; /*", "neck": "首"}
    model = replace(model, chains=replace(model.chains, names=tuple(names)), training={"reads": reads})
    export_c(model, tmp_path / "hair.h")
    source = """#include "hair.h"
#include <stdio.h>
int main(void) {
  int i;
  for (i = 0; i < NL_HAIR_JOINTS; ++i) printf("%s|", nl_hair_joint_name(i));
  return 0;
}
"""
    printed = subprocess.run([compiled(tmp_path, source)], capture_output=True, check=True).stdout.decode()
    assert printed.split("|")[:-1] == names
    header = (tmp_path / "hair.h").read_text(encoding="ascii")  # no compiler's code page can misread that
    assert "as they are named in its rig: head __ int y_ __, neck \\u9996\n" in header


def test_what_an_engine_gets_states_its_licence(tmp_path):
    export_c(random_model(), tmp_path / "hair.h")
    for name in ("hair.h", "hair_example.c"):
        assert (tmp_path / name).read_text().startswith("/* SPDX-License-Identifier: Apache-2.0 */\n")


def test_a_long_list_of_chains_ends_after_a_whole_name(tmp_path):
    """And says that it goes on: nobody should look for a joint by half of a name."""
    model = random_model((1,) * 60)
    export_c(model, tmp_path / "hair.h")
    *listed, last = re.search(r"; chains: (.*)", (tmp_path / "hair.h").read_text())[1].split(", ")
    assert last == "..." and 10 < len(listed) < 60
    assert listed == model.chains.tops[: len(listed)]

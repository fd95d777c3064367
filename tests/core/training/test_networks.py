# SPDX-License-Identifier: Apache-2.0
"""The strand network, what its offsets mean, and its way into ONNX."""

import numpy as np
import pytest
import torch

from neuralocks_core.models.network_sizes import STRAND
from neuralocks_core.training.autoencoder import StrandAutoencoder, train_autoencoder
from neuralocks_core.training.export import strand_graphs
from neuralocks_core.training.networks import RANKS, StrandNet, deform, smoothing
from tests.strand_models import offsets_of

HISTORY = slice(40, 100)


@pytest.fixture
def rest():
    generator = torch.Generator().manual_seed(3)
    steps = torch.randn(6, 24, 3, generator=generator) * 0.01 + torch.tensor([0.0, -0.01, 0.0])
    return steps.cumsum(1)


def _net(motion="linear", static=False, strand_map="linear"):
    torch.manual_seed(0)
    net = StrandNet(100, motion=motion, strand_map=strand_map)
    frames = torch.randn(64, 100) * torch.linspace(0.01, 30, 100) + 2
    frames[:, 7:9] = torch.tensor([0.3, -30.0])
    net.set_normalisation(torch.randn(50, STRAND) * 3 + 1, frames, HISTORY, static=static)
    return net


def _run(graph, output=None, **inputs):
    import onnxruntime

    session = onnxruntime.InferenceSession(graph, providers=["CPUExecutionProvider"])
    return session.run(output and [output], {k: v.numpy() for k, v in inputs.items()})[0]


def _frame(graph, frame):
    import onnxruntime

    session = onnxruntime.InferenceSession(graph, providers=["CPUExecutionProvider"])
    values = session.run(None, {"frame": frame.numpy()})
    return {output.name: torch.from_numpy(value) for output, value in zip(session.get_outputs(), values)}


@torch.no_grad()
def _weights_in_frame(net, part):
    """Second and output layer's (in, out) weights for this frame's part (1, P)."""
    middle, out = net.middle.weight.T.clone(), net.out.weight.T.clone()
    if net.motion != "modulated":
        return middle, out
    _, one, two, *terms = part[0].split([256, 256, 256, *RANKS])
    for weights, change, term in zip((middle, out), (net.middle_change, net.out_change), terms):
        weights += (change.to_terms.weight.T * term) @ change.back.weight.T
    return middle * one[:, None], out * two[:, None]


def test_the_weights_in_a_frame_are_what_the_network_computes_with():
    net = _net("modulated")
    strands, frame = net.strand_part(torch.randn(9, STRAND)), net.frame_part(torch.randn(1, 100))
    middle, out = _weights_in_frame(net, frame)
    second = torch.relu(torch.relu(strands + frame[:, :256]) @ middle + net.middle.bias)
    torch.testing.assert_close(second @ out + net.out.bias, net.tail(strands, frame), atol=1e-5, rtol=1e-4)


def test_the_split_first_layer_is_one_linear_layer():
    net = _net()
    whole = torch.nn.Linear(STRAND + 100, 256)
    with torch.no_grad():
        whole.weight.copy_(torch.cat([net.strand.weight, net.frame.weight], 1))
        whole.bias.copy_(net.frame.bias)
    strands, frame = torch.randn(5, STRAND), torch.randn(1, 100)
    normal = torch.cat(
        [
            (strands - net.strand_mean) * net.strand_scale,
            ((frame - net.frame_mean) * net.frame_scale).expand(5, -1),
        ],
        1,
    )
    torch.testing.assert_close(net.strand_part(strands) + net.frame_part(frame), whole(normal), atol=2e-5, rtol=1e-5)


@pytest.mark.parametrize(
    ("motion", "strand_map", "output"),
    [("linear", "linear", "direction"), ("encoder", "deep", "displacement"), ("modulated", "deep", "direction")],
)
def test_onnx_graphs_take_si_inputs_and_agree_with_torch(motion, strand_map, output):
    net, autoencoder = _net(motion, strand_map=strand_map), StrandAutoencoder(principal=motion != "encoder")
    shapes = torch.randn(9, 72) * 0.1 + 0.3
    autoencoder.set_normalisation(shapes)
    graphs = strand_graphs(autoencoder, net, output)
    assert set(graphs) == {"encoder.onnx", "strand.onnx", "frame.onnx", "tail.onnx"}
    np.testing.assert_allclose(
        _run(graphs["encoder.onnx"], shape=shapes), autoencoder.encode(shapes).detach(), atol=2e-3
    )
    strands, frame = torch.randn(9, STRAND) * 3 + 1, torch.randn(1, 100) * torch.linspace(0.01, 30, 100) + 2
    rest = (torch.randn(9, 24, 3) * 0.01 + torch.tensor([0.0, -0.01, 0.0])).cumsum(1)
    anchor = torch.randn(9, 24, 3)
    anchor[:, :2] = 0
    # The smoothing of directions along a strand is part of the graphs' last layer.
    along = torch.from_numpy(smoothing()).float() if output == "direction" else torch.eye(24)
    read = torch.kron(along.T.contiguous(), torch.eye(3))
    inputs = {
        "strand_part": torch.from_numpy(_run(graphs["strand.onnx"], strand=strands)),
        **_frame(graphs["frame.onnx"], frame),
        "anchor": (along @ anchor).reshape(9, 72),
        "edges": torch.cat([torch.zeros(9, 1, 3), rest.diff(dim=1)], 1).reshape(9, 72),
    }
    close = 1e-4 if motion == "linear" else 2e-3  # deep maps are stored in float16
    part = net.frame_part(frame).detach()
    np.testing.assert_allclose(inputs["frame_part"], part[:, :256], atol=close)
    # Vertices 0 and 1 are clamped; the network's answer for them is not used.
    middle, out = _weights_in_frame(net, part)
    out = out @ read
    out[:, :6] = 0
    if motion == "modulated":
        for name, weights in (("middle", middle), ("out", out)):
            np.testing.assert_allclose(inputs[name], weights, atol=close)
        middle, out = inputs["middle"], inputs["out"]
    np.testing.assert_allclose(inputs["strand_part"], net.strand_part(strands).detach(), atol=close)
    # From here on exact: what is computed per strand and frame is stored as it is.
    with torch.no_grad():
        second = torch.relu(torch.relu(inputs["strand_part"] + inputs["frame_part"]) @ middle + net.middle.bias)
        offsets = second @ out + net.out.bias @ read * (torch.arange(72) >= 6)
    np.testing.assert_allclose(_run(graphs["tail.onnx"], **inputs), offsets, atol=1e-5)
    offsets = torch.linalg.solve(along.double(), offsets.reshape(9, 24, 3).double()).float()
    moved = _run(graphs["tail.onnx"], "displacement", **inputs)
    np.testing.assert_allclose(moved, deform(offsets, rest, anchor, output).detach().reshape(9, 72), atol=2e-6)
    assert strand_graphs(autoencoder, net, output) == graphs, "the same weights give the same bytes"


def test_hair_of_a_network_that_is_unsure_does_not_zigzag():
    """Edges with alternating directions would make hair shorter; only a slope at the tip is left of such an answer."""
    rest = torch.linspace(0, 0.2, 24)[None, :, None] * torch.tensor([0.0, -1.0, 0.0])
    sign = (-1.0) ** torch.arange(24)
    offsets = sign[None, :, None] * torch.tensor([0.8, 0.0, 0.0])
    moved = rest + deform(offsets, rest)
    assert moved[0, :, 1].diff().abs().sum() > 0.99 * 0.2
    steady = rest + deform(torch.full((1, 24, 1), 0.8) * torch.tensor([1.0, 0.0, 0.0]), rest)
    edges = steady[0, 2:].diff(dim=0)
    torch.testing.assert_close(edges, edges[:1].expand_as(edges), msg="what is the same for all edges stays whole")


def test_a_static_network_does_not_read_the_history():
    net = _net(static=True)
    frames = torch.randn(1, 100).repeat(2, 1)
    frames[1, HISTORY] += 100.0
    still, moving = offsets_of(net, torch.randn(4, STRAND), frames)
    assert torch.equal(still, moving)
    assert not torch.equal(*offsets_of(_net(), torch.randn(4, STRAND), frames))


def test_inputs_are_scaled_by_how_far_they_vary_the_history_less_and_details_no_farther():
    """Stillness is exactly zero in the history, and stays so. A code's last components vary a hundredth as much as its first."""
    generator = torch.Generator().manual_seed(0)
    frames, strands = (torch.randn(400, size, generator=generator) * 3 + 2 for size in (100, STRAND))
    strands[:, 3] *= 0.001
    strands[:, 66] *= 0.001
    net = StrandNet(100)
    net.set_normalisation(strands, frames, HISTORY)
    assert not net.frame_mean[HISTORY].any()
    rms, spread = frames[:, HISTORY].square().mean(0).sqrt(), frames[:, :40].std(0)
    torch.testing.assert_close(net.frame_scale[HISTORY], 0.25 / rms, rtol=1e-4, atol=0)
    torch.testing.assert_close(net.frame_scale[:40], 1 / spread, rtol=1e-2, atol=0)
    torch.testing.assert_close(net.frame_mean[:40], frames[:, :40].mean(0), rtol=1e-4, atol=1e-5)
    largest = strands[:, 2:66].std(0).max().item()
    assert net.strand_scale[3].item() == pytest.approx(50 / largest, rel=1e-2)
    assert net.strand_scale[66].item() == pytest.approx(
        1 / strands[:, 66].std().item(), rel=1e-2
    )  # of the root normal, no code


def test_an_input_that_never_varied_is_not_read():
    net = _net()
    frames = torch.zeros(2, 100)
    frames[1, 7:9] = 50.0
    assert torch.equal(*offsets_of(net, torch.randn(4, STRAND), frames))


def test_own_strands_in_each_frame_equal_the_same_strands_for_all():
    net, strands, frames = _net(), torch.randn(4, STRAND), torch.randn(3, 100)
    torch.testing.assert_close(offsets_of(net, strands, frames), offsets_of(net, strands.expand(3, 4, STRAND), frames))


def test_zero_offsets_are_exactly_the_groom(rest):
    for output in ("direction", "displacement"):
        assert not deform(torch.zeros(2, 6, 24, 3), rest, output=output).any()


def test_direction_keeps_every_edge_length_and_clamps_the_first_edge(rest):
    moved = rest + deform(torch.randn(5, 6, 24, 3), rest)
    torch.testing.assert_close(moved.diff(dim=-2).norm(dim=-1), rest.diff(dim=-2).norm(dim=-1).expand(5, 6, 23))
    assert torch.equal(moved[..., :2, :], rest[:, :2].expand(5, 6, 2, 3))


def test_direction_turns_the_edge_that_ends_at_the_vertex():
    rest = torch.zeros(1, 24, 3)
    rest[0, :, 1] = -torch.arange(24.0)
    offsets = torch.zeros(1, 24, 3)
    offsets[0, 5] = torch.tensor([1.0, 1.0, 0.0])  # (0,-1,0) + (1,1,0) = (1,0,0)
    before = torch.linalg.solve(torch.from_numpy(smoothing()), offsets.double()).float()
    moved = deform(before, rest)[0]
    assert moved[:5].abs().max() < 1e-5
    torch.testing.assert_close(moved[5:], torch.tensor([1.0, 1.0, 0.0]).expand(19, 3), atol=1e-4, rtol=0)


def test_the_anchor_gives_the_groom_in_the_anchored_pose(rest):
    offsets = torch.randn(1, 6, 24, 3)
    assert not deform(offsets, rest, anchored_offsets=offsets).any()


def test_degenerate_edges_and_opposite_offsets_stay_finite():
    rest = torch.zeros(1, 24, 3)
    rest[0, 2:, 1] = -torch.arange(22.0)
    offsets = torch.zeros(1, 24, 3)
    offsets[0, 5] = torch.tensor([0.0, 1.0, 0.0])  # cancels the edge
    offsets.requires_grad_()
    moved = deform(offsets, rest)
    moved.square().sum().backward()
    assert moved.isfinite().all() and offsets.grad.isfinite().all()


def test_the_autoencoder_learns_strands_and_is_reproducible():
    rng = np.random.default_rng(0)
    along = np.linspace(0, 1, 24)[None, :, None]
    curl = rng.uniform(0, 6, (400, 1, 1)) * along
    length = rng.uniform(0.05, 0.3, (400, 1, 1))
    shapes = length * np.concatenate([along + 0 * length, 0.2 * np.sin(curl), 0.2 * along * np.cos(curl)], -1)
    first = train_autoencoder(shapes[:300], steps=100, batch=128)
    short, again = (train_autoencoder(shapes[:300], steps=20, batch=128) for _ in range(2))
    paper = train_autoencoder(shapes[:300], steps=200, batch=128, rate=1e-3, principal=False)
    assert first.errors(shapes[300:]).mean() < 0.001
    assert paper.errors(shapes[300:]).mean() < 0.01
    np.testing.assert_array_equal(short.codes(shapes), again.codes(shapes))
    assert first.codes(shapes).shape == (400, 32)
    assert not any(p.requires_grad for p in first.parameters())

"""The network that scores entries: the torch twin's numbers, no matter how many entries, in which batch or order."""

import json
import shutil
import struct
from pathlib import Path

import numpy as np
import pytest
import torch

from wsn_env import Scenario, make_policy
from wsn_env.agents.ppo import PPOPolicy
from wsn_env.learning.actor_critic import CHUNK, EntryActorCritic
from wsn_env.learning.network import EntryNetwork, FlatNetwork, PolicyNetwork

BELIEF, ENTRY = 7, 5
SCENARIO = Scenario.named("PreDC-v0")


def actor(outputs: int, entries: int = 6) -> EntryActorCritic:
    torch.manual_seed(1)
    made = EntryActorCritic(BELIEF, ENTRY, entries, BELIEF + entries * ENTRY, outputs, actor=(9, 8), critic=(4, 4))
    for parameter in made.parameters():
        torch.nn.init.normal_(parameter)
    return made


def observations(entries: int, rows: int = 33) -> np.ndarray:
    return np.random.default_rng(0).normal(size=(rows, BELIEF + entries * ENTRY)).astype(np.float32)


@pytest.mark.parametrize("outputs", [1, 2])
def test_numpy_and_torch_agree(outputs):
    twin = actor(outputs)
    given = observations(6)
    with torch.no_grad():
        wanted = twin(torch.as_tensor(given))[0].numpy()
    found = twin.actor_network().logits(given)
    assert found.shape == wanted.shape == (33, 6 if outputs == 1 else 1 + 6 + 2 * 6)
    assert np.allclose(found, wanted, rtol=1e-4, atol=1e-4)
    assert (found == np.concatenate([twin.actor_network().logits(row[None]) for row in given])).all()


@pytest.mark.parametrize("outputs", [1, 2])
def test_the_gradient_by_hand_is_that_of_finite_differences(outputs):
    """In more rows than one chunk; what only the critic sees, at the end, moves no logit."""
    twin = actor(outputs).double()
    rows = CHUNK + 3
    given = torch.as_tensor(observations(6, rows)).double()
    weights = torch.randn(rows, 6 if outputs == 1 else 19, dtype=torch.double)
    (twin.forward_actor(given) * weights).sum().backward()
    parts = [twin.belief, twin.entry, twin.hidden, twin.score]
    for parameter in (one for part in parts for one in part.parameters()):
        place = tuple(np.random.default_rng(3).integers(size) for size in parameter.shape)
        totals = []
        for step in (1e-6, -1e-6):
            with torch.no_grad():
                parameter[place] += step
                totals.append(float((twin.forward_actor(given) * weights).sum()))
                parameter[place] -= step
        slope = (totals[0] - totals[1]) / 2e-6
        assert float(parameter.grad[place]) == pytest.approx(slope, rel=1e-4, abs=1e-4)
    more = torch.cat([given, torch.full((rows, 4), 9.0)], dim=1)
    assert torch.equal(twin.forward_actor(more), twin.forward_actor(given))


def test_an_entry_has_the_same_logit_wherever_it_stands_and_whatever_else_there_is():
    network = actor(1).actor_network()
    given = observations(6)
    entries = given[:, BELIEF:].reshape(33, 6, ENTRY)
    turned = np.concatenate([given[:, :BELIEF], entries[:, ::-1].reshape(33, -1)], axis=1)
    assert (network.logits(turned) == network.logits(given)[:, ::-1]).all()
    fewer = np.concatenate([given[:, :BELIEF], entries[:, :2].reshape(33, -1)], axis=1)
    assert (network.logits(fewer) == network.logits(given)[:, :2]).all()


def test_a_candidate_too():
    network = actor(2).actor_network()
    many, few = observations(6), None
    few = many[:, : BELIEF + 4 * ENTRY]
    ours, theirs = network.logits(few), network.logits(many)
    assert (ours[:, :5] == theirs[:, :5]).all()  # the present head and the first four leading
    assert (ours[:, 5:] == theirs[:, 7 : 7 + 8]).all()  # out and in of the first four
    assert (ours[:, 5::2] == 0).all()  # staying out is what being in is measured against
    assert network.fits(BELIEF + 4 * ENTRY, 13) and network.fits(BELIEF + 6 * ENTRY, 19)
    assert not network.fits(BELIEF + 4 * ENTRY, 14) and not network.fits(BELIEF + 4 * ENTRY + 1, 13)


def test_files_tell_the_kinds_apart(tmp_path):
    rng = np.random.default_rng(2)
    sizes = dict(observation=6, first=4, second=3, logits=2)
    flat = FlatNetwork({name: rng.normal(size=[sizes[a] for a in axes]) for name, axes in FlatNetwork.SHAPES.items()})
    for network in (flat, actor(1).actor_network()):
        network.save(tmp_path / "policy.safetensors")
        again = PolicyNetwork.load(tmp_path / "policy.safetensors")
        assert type(again) is type(network)
        assert all((again.arrays[name] == array).all() for name, array in network.arrays.items())
    with pytest.raises(ValueError, match="does not fit"):
        EntryNetwork(network.arrays | {"score.bias": np.zeros(3)})
    with pytest.raises(ValueError, match="not finite"):
        EntryNetwork(network.arrays | {"score.bias": np.array([np.inf])})


DTYPES = ["BF16", "F8_E4M3", "F8_E5M2", "I32", "I8", "U64", "F16", "F64", "BOOL"]
SIZES = {"BF16": 2, "F8_E4M3": 1, "F8_E5M2": 1, "I32": 4, "I8": 1, "U64": 8, "F16": 2, "F64": 8, "BOOL": 1, "F32": 4}
SHIPPED = Path(__file__).parents[1] / "agents" / "pretrained" / "PreDC-v0"


def weights_file(path, dtype="F32", change=lambda shapes: shapes):
    """A safetensors file of zeros in the shapes of a small network."""
    lengths = dict(belief=3, entry=2, first=4, second=4, outputs=1)
    shapes = change({name: [lengths[axis] for axis in axes] for name, axes in EntryNetwork.SHAPES.items()})
    header, start = {}, 0
    for name, shape in shapes.items():
        stop = start + SIZES[dtype] * int(np.prod(shape))
        header[name] = {"dtype": dtype, "shape": shape, "data_offsets": [start, stop]}
        start = stop
    text = json.dumps(header).encode()
    path.write_bytes(struct.pack("<Q", len(text)) + text + bytes(start))
    return path


@pytest.mark.parametrize("dtype", DTYPES)
def test_weights_of_another_type_are_refused_by_name(tmp_path, dtype):
    path = weights_file(tmp_path / "policy.safetensors", dtype)
    with pytest.raises(ValueError, match="policy.safetensors is not a saved network of float32") as refused:
        PolicyNetwork.load(path)
    assert "\n" not in str(refused.value)
    assert PolicyNetwork.load(weights_file(path)).sizes["entry"] == 2


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda s: s | {"score.bias": [3]}, "score.bias of shape .3,. does not fit"),
        (lambda s: s | {"belief.weight": [3, 4, 1]}, "does not fit"),
        (lambda s: s | {"belief.bias": []}, "does not fit"),
        (lambda s: s | {"entry.weight": [0, 4]}, "is empty"),
        (lambda s: {name: s[name] for name in s if name != "hidden.bias"}, "lacks the array 'hidden.bias'"),
        (lambda s: {"entry.weight": [2, 4]}, "lacks the array"),
        (lambda s: {}, "lacks the array"),
    ],
)
def test_weights_of_another_shape_are_refused_by_name(tmp_path, change, words):
    with pytest.raises(ValueError, match=f"policy.safetensors is not a saved network.*{words}"):
        PolicyNetwork.load(weights_file(tmp_path / "policy.safetensors", change=change))


WHOLE = {"kind": "ppo", "interface": {"action": "menu", "observation": "menu", "reward": "error", "order": "nearest"}}
TEXTS = {
    "empty": "",
    "cut": '{"kind": "ppo", "interf',
    "deep": '{"kind": ' + "[" * 100_000 + "]" * 100_000 + "}",
    "a list": "[1, 2]",
    "a number": "3",
    "null": "null",
    "a string": '"kind"',
    "no kind": '{"interface": {}}',
    "no interface": '{"kind": "ppo"}',
    "interface is a number": '{"kind": "ppo", "interface": 5}',
    "interface is a list": '{"kind": "ppo", "interface": [["action", "menu"]]}',
    "unknown setting": json.dumps(WHOLE | {"interface": WHOLE["interface"] | {"colour": 1}}),
    "unknown action": json.dumps(WHOLE | {"interface": WHOLE["interface"] | {"action": "cluster"}}),
    "action is a list": json.dumps(WHOLE | {"interface": WHOLE["interface"] | {"action": []}}),
    "unknown order": json.dumps(WHOLE | {"interface": WHOLE["interface"] | {"order": "x"}}),
    "order is a table": json.dumps(WHOLE | {"interface": WHOLE["interface"] | {"order": {}}}),
    "unknown reward": json.dumps(WHOLE | {"interface": WHOLE["interface"] | {"reward": None}}),
    "bytes": b"\xff\xfe\x00",
}


@pytest.mark.parametrize("text", TEXTS.values(), ids=TEXTS)
@pytest.mark.parametrize("direct", [False, True])
def test_a_damaged_policy_file_is_refused_by_name(tmp_path, text, direct):
    path = tmp_path / "policy.json"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    (tmp_path / "policy.safetensors").write_bytes((SHIPPED / "policy.safetensors").read_bytes())
    with pytest.raises(ValueError) as refused:
        policy = PPOPolicy(SCENARIO, path=str(path)) if direct else make_policy(str(path), SCENARIO)
        repr(policy)
    said = str(refused.value)
    assert "policy.json" in said and "\n" not in said and len(said) < 500, said


def test_a_folder_in_place_of_a_file_is_refused_by_name(tmp_path):
    for name in ("policy.json", "policy.safetensors"):
        folder = shutil.copytree(SHIPPED, tmp_path / name.replace(".", "_"))
        (folder / name).unlink()
        (folder / name).mkdir()
        for path in (folder, folder / "policy.json"):
            with pytest.raises(ValueError, match=f"{name} is not a saved .*: there is no such file"):
                repr(make_policy(str(path), SCENARIO))


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_weights_that_are_not_finite_are_refused_by_name(tmp_path, value):
    shutil.copy(SHIPPED / "policy.json", tmp_path)
    network = PolicyNetwork.load(SHIPPED / "policy.safetensors")
    network.arrays["score.bias"] = np.full_like(network.arrays["score.bias"], value)
    network.save(tmp_path / "policy.safetensors")
    with pytest.raises(ValueError, match="policy.safetensors is not a saved network.*score.bias.*not finite"):
        repr(make_policy(str(tmp_path), SCENARIO))


@pytest.mark.parametrize("share", [0, 0.001, 0.5, 0.999])
def test_weights_cut_short_are_refused_by_name(tmp_path, share):
    shutil.copy(SHIPPED / "policy.json", tmp_path)
    whole = (SHIPPED / "policy.safetensors").read_bytes()
    (tmp_path / "policy.safetensors").write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(ValueError, match="policy.safetensors is not a saved network.*cut short"):
        repr(make_policy(str(tmp_path), SCENARIO))

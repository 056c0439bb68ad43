"""The network that scores entries: the torch twin's numbers, no matter how many entries, in which batch or order."""

import numpy as np
import pytest
import torch

from wsn_env.learning.actor_critic import EntryActorCritic
from wsn_env.learning.network import EntryNetwork, FlatNetwork, PolicyNetwork

BELIEF, ENTRY = 7, 5


def actor(outputs: int, entries: int = 6) -> EntryActorCritic:
    torch.manual_seed(1)
    made = EntryActorCritic(BELIEF, ENTRY, BELIEF + entries * ENTRY, outputs, actor=(9, 8), critic=(4, 4))
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

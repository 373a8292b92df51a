"""Compiled closures carry names of their own: two processes' cached machine code is linked by name."""

from controllers import lead, pid
from steer_env.envs import batch
from steer_env.envs.layout import PARAMETERS, STATE
from steer_env.manoeuvres import MANOEUVRES, hand_at
from steer_env.physics import _cache


def test_no_two_closures_of_one_signature_share_a_name():
    """Catches a rollout from the cache that calls another manoeuvre, loader or law: wrong scores without a word."""
    loaders = [layout.loader(name) for layout in (PARAMETERS, STATE) for name in layout.records]
    names = [function.__qualname__ for function in loaders]
    others = hand_at
    while others is not None:
        names.append(others.__qualname__)
        cells = dict(zip(others.__code__.co_freevars, others.__closure__, strict=True))
        others = cells["others"].cell_contents if "others" in cells else None
    laws = (pid.torque_law, pid.angle_law, lead.torque_law, lead.angle_law)
    names += [batch.make_rollout(law).py_func.__qualname__ for law in laws]
    assert len(set(names)) == len(names) == len(loaders) + len(MANOEUVRES) + len(laws)


def test_code_around_a_law_around_a_law_is_kept_under_both_their_sources(monkeypatch):
    """Catches machine code that outlives a change of the law that it closes over at second hand."""
    inner = pid.torque_law

    def closing(o, x, p):
        return inner(o, x, p)

    seen = []
    monkeypatch.delenv("STEER_ENV_CACHE", raising=False)
    monkeypatch.setattr(_cache, "_hash_of", lambda root: seen.append(root.name) or b"")
    _cache.folder_of((closing,))
    assert "controllers" in seen

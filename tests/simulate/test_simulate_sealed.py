"""Machine code in the cache: stale, broken, exchanged or planted files are never run, and certify uses none."""

import importlib.util
import os
import pickle
import subprocess
import sys

import pytest
from simulated import FLAT

from tubecert.kept import user_key
from tubecert.simulate import compiled, sealed
from tubecert.simulate.sealed import SealedFile

SOURCE = """
from tubecert.simulate.compiled import compiled, entry

@compiled
def doubled(x):
    return 2 * x

@entry
def kernel(x):
    return doubled(x) + 1

@entry
def other(x):
    return doubled(x) - 1
"""


@pytest.fixture(autouse=True)
def state(tmp_path, monkeypatch):
    """A state folder of its own, hence a key of its own."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setattr(compiled, "_NAMES", [])
    return tmp_path / "state" / "tubecert"


@pytest.fixture
def kernels(tmp_path):
    """Loads a module of kernels as a new process would; its machine code goes beside it."""
    path = tmp_path / "made.py"
    path.write_text(SOURCE)

    def load():
        spec = importlib.util.spec_from_file_location("made", path)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module

    return load


def used(kernels, name="kernel"):
    """The value at 20, and whether the machine code came from the cache."""
    function = getattr(kernels(), name)
    value = function(20.0)
    return value, bool(function.stats.cache_hits)


def files(tmp_path, name="kernel"):
    (found,) = (tmp_path / "__pycache__").glob(f"made.{name}-*.kernel")
    return found


def test_machine_code_is_kept(kernels, tmp_path):
    assert used(kernels) == (41.0, False)
    assert used(kernels) == (41.0, True)
    assert not list((tmp_path / "__pycache__").glob("*.nb?"))


def flipped(data):
    return data[:-100] + bytes([data[-100] ^ 1]) + data[-99:]


@pytest.mark.slow
@pytest.mark.parametrize(
    "change",
    [
        lambda data: b"",
        lambda data: data[:20],
        lambda data: data[:-1],
        lambda data: data + b"x",
        lambda data: data[32:],
        lambda data: bytes(32) + data[32:],
        lambda data: b"not a cache file at all, but some text that was left here by somebody",
        flipped,
    ],
    ids=["empty", "short", "cut", "longer", "no seal", "zero seal", "text", "one bit"],
)
def test_broken_machine_code_is_compiled_again(kernels, tmp_path, change):
    used(kernels)
    path = files(tmp_path)
    path.write_bytes(change(path.read_bytes()))
    assert used(kernels) == (41.0, False)
    assert used(kernels) == (41.0, True)  # and is whole again


class Planted:
    """Unpickled, it leaves a mark."""

    def __init__(self, mark):
        self.mark = mark

    def __reduce__(self):
        return os.mkdir, (str(self.mark),)


@pytest.mark.slow
def test_planted_machine_code_is_never_unpickled(kernels, tmp_path, monkeypatch):
    """Without a seal, under another key, and as numba's own kinds of files."""
    used(kernels)
    path, mark = files(tmp_path), tmp_path / "was_here"
    planted = pickle.dumps([(Planted(mark), Planted(mark))])
    for content in (planted, bytes(32) + planted, path.read_bytes()[:32] + planted):
        path.write_bytes(content)
        assert used(kernels) == (41.0, False)
        assert not mark.exists()
    for suffix in (".nbi", ".1.nbc"):
        path.with_suffix(suffix).write_bytes(pickle.dumps("0.0") + planted)
    assert used(kernels) == (41.0, True)
    assert not mark.exists()
    with monkeypatch.context() as somebody:
        somebody.setattr(sealed, "user_key", lambda: b"k" * 32)
        SealedFile(path, compiled._stamp())._write([(Planted(mark), Planted(mark))])
    assert used(kernels) == (41.0, False)
    assert not mark.exists()
    with pytest.raises(FileExistsError):  # what is planted does act where it is unpickled, twice
        pickle.loads(planted)
    assert mark.exists()


@pytest.mark.slow
def test_files_of_other_kernels_and_of_other_sources_do_not_fit(kernels, tmp_path, monkeypatch):
    used(kernels), used(kernels, "other")
    own, foreign = files(tmp_path), files(tmp_path, "other")
    content = own.read_bytes()
    own.write_bytes(foreign.read_bytes())
    assert used(kernels) == (41.0, False)
    own.write_bytes(content)
    assert used(kernels) == (41.0, True)
    monkeypatch.setattr(compiled, "_stamp", lambda: "another source")
    assert used(kernels) == (41.0, False)
    assert used(kernels) == (41.0, True)
    own.write_bytes(content)  # what an older version has sealed
    assert used(kernels) == (41.0, False)


def pipe_beside(path):
    """What a link may lead to, and must not be replaced: no device of this machine, in case it is."""
    pipe = path.with_suffix(".pipe")
    os.mkfifo(pipe)
    return pipe


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes here")
@pytest.mark.parametrize(
    "make", [os.mkdir, getattr(os, "mkfifo", None), lambda path: path.symlink_to(pipe_beside(path))]
)
def test_what_is_no_file_does_not_stop_anything(kernels, tmp_path, make):
    used(kernels)
    path = files(tmp_path)
    path.unlink()
    make(path)
    assert used(kernels)[0] == 41.0


def test_a_disk_that_is_full_does_not_stop_anything(kernels, monkeypatch):
    def full(path, data):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(sealed, "replace", full)
    assert used(kernels) == (41.0, False)
    assert used(kernels) == (41.0, False)


def test_the_key_is_the_users_alone(state):
    secret = user_key()
    path = state / "cache.key"
    assert path.read_bytes() == secret
    assert len(set(secret)) > 8
    if os.name == "posix":
        assert path.stat().st_mode & 0o777 == 0o600
    assert user_key() == secret


@pytest.mark.skipif(os.name != "posix", reason="permissions of POSIX")
@pytest.mark.parametrize("spoil", ["open", "short", "long", "link", "folder"])
def test_a_key_that_others_may_know_is_replaced(state, tmp_path, spoil):
    old = user_key()
    path = state / "cache.key"
    if spoil == "open":
        path.chmod(0o644)
    elif spoil in ("short", "long"):
        path.write_bytes(old[:31] if spoil == "short" else old + b"x")
    else:
        path.unlink()
        planted = tmp_path / "planted"
        planted.write_bytes(b"k" * 32)
        planted.chmod(0o600)
        path.symlink_to(planted) if spoil == "link" else path.mkdir()
    found = user_key()
    if spoil == "folder":
        assert found is None
        return
    assert found not in (old, b"k" * 32)
    assert path.stat().st_mode & 0o777 == 0o600
    assert not path.is_symlink()


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="no owners here")
def test_a_key_of_another_user_is_not_used(state, monkeypatch):
    assert user_key() is not None
    monkeypatch.setattr(os, "geteuid", lambda: 12345)
    assert user_key() is None


def test_without_a_place_for_the_key_nothing_is_kept(kernels, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "file"))
    assert used(kernels) == (41.0, False)
    assert not list((tmp_path / "__pycache__").glob("*.kernel"))
    assert used(kernels) == (41.0, False)


@pytest.mark.slow
def test_certification_neither_loads_kernels_nor_numba(tmp_path):
    """A simulation may falsify a certificate; what certifies does not even import what simulates."""
    (tmp_path / "flat.yaml").write_text(FLAT)
    code = (
        "import sys; from typer.testing import CliRunner; from tubecert.cli.app import app;"
        "done = CliRunner().invoke(app, ['certify', 'flat.yaml', '-o', 'flat.json']); assert not done.exit_code;"
        "print([name for name in sys.modules if name.startswith(('numba', 'llvmlite', 'tubecert.simulate'))])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.stdout.strip() == "[]", done.stderr

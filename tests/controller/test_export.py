"""`export`: what is written, over what, and for which certificates; attacks on the folder."""

import os

import handmade
import pytest
from commands import run

import tubecert as tc
from tubecert.controller.data import data_of
from tubecert.controller.folder import files_of, write
from tubecert.errors import TargetError, TubecertError
from tubecert.sampled_loop.record import Claim, Lack, certificate_text
from tubecert.verdict import Verdict

NAMES = {"controller.c", "controller.h", "controller_data.h", "selftest.c", "README.txt"}


def code(**options):
    return files_of(data_of(handmade.certificate(**options)))


@pytest.fixture(scope="module")
def files():
    return code()


def saved(folder, **options):
    path = folder / "cart.certificate.json"
    path.write_text(certificate_text(handmade.certificate(**options)))
    return path


def held(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.slow
def test_the_command_writes_a_folder_with_spaces_and_the_library_the_same(tmp_path, monkeypatch, files):
    monkeypatch.chdir(tmp_path)
    path = saved(tmp_path)
    done = run("export", "cart.certificate.json", "-o", "my controller")
    assert done.exit_code == 0, done.output
    assert "multiply-adds" in done.output
    assert run("export", "cart.certificate.json", "-q").output == ""
    assert set(tc.export(path, tmp_path / "c").files) == NAMES
    for name in ("my controller", "cart.controller", "c"):
        assert held(tmp_path / name) == files


def test_what_was_written_is_replaced_by_another_certificate_also_through_a_link_that_was_named(
    tmp_path, files
):
    (tmp_path / "disk").mkdir()
    (tmp_path / "c").symlink_to(tmp_path / "disk")
    for own in (code(z=3), files):
        write(str(tmp_path / "c"), own)
        assert held(tmp_path / "disk") == own


ATTACKS = {
    "changed": lambda path: path.write_bytes(path.read_bytes().replace(b"static", b"static ", 1)),
    "foreign": lambda path: path.write_text("my own file\n"),
    "linked": lambda path: (path.rename(path.parent.parent / "outside.c"), path.symlink_to("../outside.c")),
    "dangling": lambda path: (path.unlink(), path.symlink_to("../nowhere.c")),
    "folder": lambda path: (path.unlink(), path.mkdir()),
    "pipe": lambda path: (path.unlink(), os.mkfifo(path)),
}


@pytest.mark.parametrize("attack", ATTACKS)
@pytest.mark.parametrize("name", ["controller.c", "controller_data.h"])
def test_what_tubecert_did_not_write_stays(tmp_path, files, name, attack):
    home = tmp_path / "c"
    write(str(home), code(z=1))
    ATTACKS[attack](home / name)
    before = {path: path.lstat().st_mtime_ns for path in (*home.iterdir(), *tmp_path.iterdir())}
    with pytest.raises(TargetError, match="cannot write") as caught:
        write(str(home), files)
    assert "another folder" in caught.value.findings[0].help
    assert {path: path.lstat().st_mtime_ns for path in (*home.iterdir(), *tmp_path.iterdir())} == before


@pytest.mark.skipif(os.geteuid() == 0, reason="root writes everywhere")
def test_a_folder_that_is_read_only(tmp_path, files):
    tmp_path.chmod(0o500)
    with pytest.raises(TargetError, match="permission denied"):
        write(str(tmp_path), files)


def test_a_file_in_place_of_the_folder_and_a_folder_that_cannot_be(tmp_path, files):
    (tmp_path / "c").write_text("")
    for name in ("c", "no/such", "a\0b"):
        with pytest.raises(TargetError, match="cannot write"):
            write(str(tmp_path / name), files)


def test_nothing_is_half_written_when_the_disk_is_full(tmp_path, files, monkeypatch):
    write(str(tmp_path), files)
    other, written = code(z=1), []

    def full(handle: int) -> None:
        written.append(handle)
        if len(written) == len(NAMES):
            raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(TargetError, match="no space left"):
        write(str(tmp_path), other)
    assert held(tmp_path).keys() == NAMES
    assert all(content in (files[name], other[name]) for name, content in held(tmp_path).items())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "exit_code", "word"),
    [
        ({"verdict": Verdict.UNDECIDED, "lacks": (Lack(kind="no_design"),)}, 4, "undecided"),
        ({"verdict": Verdict.REFUTED}, 1, "refuted"),
        ({"controller": handmade.no_controller(), "z": 0}, 2, "no controller"),
        (
            {
                "trajectory": handmade.WAVE % "",
                "claim": Claim(horizon=None, afterwards="nothing", hold="continuous"),
            },
            2,
            "code holds it",
        ),
    ],
)
def test_what_has_no_code_is_refused_with_a_remedy(tmp_path, monkeypatch, options, exit_code, word):
    monkeypatch.chdir(tmp_path)
    saved(tmp_path, **options)
    done = run("export", "cart.certificate.json", "-o", "c")
    assert done.exit_code == exit_code
    assert word in done.output
    assert "help:" in done.output
    assert not (tmp_path / "c").exists()


@pytest.mark.slow
def test_a_certificate_of_a_continuous_loop_is_refused(tmp_path):
    other = tc.Certification(certificate=None, text="")
    with pytest.raises(TubecertError, match="continuous time") as caught:
        tc.export(other, tmp_path / "c")
    assert "hardware" in caught.value.findings[0].help

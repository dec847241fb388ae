"""`export`: what is written, over what, and for which certificates; attacks on the folder."""

import os
from pathlib import Path

import handmade
import pytest
from commands import run

import tubecert as tc
from tubecert.controller import folder as writing
from tubecert.controller.data import data_of
from tubecert.controller.folder import files_of, write
from tubecert.errors import TargetError, TubecertError
from tubecert.sampled_loop.file import certificate_text
from tubecert.sampled_loop.record import Claim, Lack
from tubecert.verdict import Verdict

CONTINUOUS = Claim(horizon=None, afterwards="nothing", hold="continuous")
NAMES = {"controller.c", "controller.h", "controller_data.h", "selftest.c", "README.txt"}


@pytest.fixture(scope="module")
def texts():
    return files_of(data_of(handmade.certificate()))


def saved(folder: Path, **options: object) -> Path:
    path = folder / "cart.certificate.json"
    path.write_text(certificate_text(handmade.certificate(**options)))
    return path


def held(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.slow
def test_the_command_writes_a_folder_with_spaces(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    saved(tmp_path)
    done = run("export", "cart.certificate.json", "-o", "my controller")
    assert done.exit_code == 0, done.output
    assert set(os.listdir(tmp_path / "my controller")) == NAMES
    assert "multiply-adds" in done.output
    assert run("export", "cart.certificate.json", "-q").output == ""
    assert set(os.listdir(tmp_path / "cart.controller")) == NAMES


@pytest.mark.slow
def test_the_library_writes_the_same(tmp_path, texts):
    found = tc.export(saved(tmp_path), tmp_path / "c")
    assert set(found.files) == NAMES
    assert held(tmp_path / "c") == {name: text.encode() for name, text in texts.items()}


def test_what_was_written_is_replaced_by_another_certificate(tmp_path, texts):
    other = files_of(data_of(handmade.certificate(z=3)))
    write(str(tmp_path), other)
    assert held(tmp_path) == {name: text.encode() for name, text in other.items()}
    write(str(tmp_path), texts)
    assert held(tmp_path) == {name: text.encode() for name, text in texts.items()}
    mode = (tmp_path / "controller.c").stat().st_mode & 0o777
    mask = os.umask(0)
    os.umask(mask)
    assert mode == 0o666 & ~mask


def changed(path: Path) -> None:
    path.write_text(path.read_text().replace("static", "static ", 1))


def foreign(path: Path) -> None:
    path.write_text("my own file\n")


def linked(path: Path) -> None:
    target = path.parent.parent / "outside.c"
    target.write_bytes(path.read_bytes())
    path.unlink()
    path.symlink_to(target)


def dangling(path: Path) -> None:
    path.unlink()
    path.symlink_to(path.parent.parent / "nowhere.c")


def folder_in_place(path: Path) -> None:
    path.unlink()
    path.mkdir()


def pipe(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


@pytest.mark.parametrize("attack", [changed, foreign, linked, dangling, folder_in_place, pipe])
@pytest.mark.parametrize("name", ["controller.c", "controller_data.h"])
def test_what_tubecert_did_not_write_stays(tmp_path, texts, name, attack):
    home = tmp_path / "c"
    write(str(home), files_of(data_of(handmade.certificate(z=1))))
    attack(home / name)
    before = {path: path.lstat().st_mtime_ns for path in home.iterdir()}
    outside = sorted(os.listdir(tmp_path))
    with pytest.raises(TargetError, match="cannot write") as caught:
        write(str(home), texts)
    assert "another folder" in caught.value.findings[0].help
    assert {path: path.lstat().st_mtime_ns for path in home.iterdir()} == before
    assert sorted(os.listdir(tmp_path)) == outside


@pytest.mark.skipif(os.geteuid() == 0, reason="root writes everywhere")
def test_a_folder_that_is_read_only(tmp_path, texts):
    tmp_path.chmod(0o500)
    with pytest.raises(TargetError, match="permission denied"):
        write(str(tmp_path), texts)
    assert os.listdir(tmp_path) == []


def test_a_file_in_place_of_the_folder_and_a_folder_that_cannot_be(tmp_path, texts):
    (tmp_path / "c").write_text("")
    for name in ("c", "no/such", "a\0b"):
        with pytest.raises(TargetError, match="cannot write"):
            write(str(tmp_path / name), texts)


def test_nothing_is_half_written_when_the_disk_is_full(tmp_path, texts, monkeypatch):
    write(str(tmp_path), texts)
    before, written = held(tmp_path), []

    def full(handle: int) -> None:
        written.append(handle)
        if len(written) == 3:
            raise OSError(28, "No space left on device")

    monkeypatch.setattr(writing.os, "fsync", full)
    with pytest.raises(TargetError, match="no space left"):
        write(str(tmp_path), files_of(data_of(handmade.certificate(z=1))))
    assert held(tmp_path) == before


@pytest.mark.slow
def test_the_folder_may_be_a_link_that_was_named(tmp_path, texts):
    (tmp_path / "disk").mkdir()
    (tmp_path / "c").symlink_to(tmp_path / "disk")
    write(str(tmp_path / "c"), texts)
    assert set(os.listdir(tmp_path / "disk")) == NAMES


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "code", "word"),
    [
        ({"verdict": Verdict.UNDECIDED, "lacks": (Lack(kind="no_design"),)}, 4, "undecided"),
        ({"verdict": Verdict.REFUTED}, 1, "refuted"),
        ({"trajectory": handmade.WAVE % "", "claim": CONTINUOUS}, 2, "code holds it"),
    ],
)
def test_what_has_no_code_is_refused_with_a_remedy(tmp_path, monkeypatch, options, code, word):
    monkeypatch.chdir(tmp_path)
    saved(tmp_path, **options)
    done = run("export", "cart.certificate.json", "-o", "c")
    assert done.exit_code == code
    assert word in done.output
    assert "help:" in done.output
    assert not (tmp_path / "c").exists()


@pytest.mark.slow
def test_a_certificate_of_a_continuous_loop_is_refused(tmp_path):
    other = tc.Certification(certificate=None, text="")
    with pytest.raises(TubecertError, match="continuous time") as caught:
        tc.export(other, tmp_path / "c")
    assert "hardware" in caught.value.findings[0].help

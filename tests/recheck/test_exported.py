"""`recheck --controller`: exported code is confirmed; what is changed in it is refused, with hashes made right."""

import hashlib
import re

import handmade
import pytest
from commands import run

from tubecert.controller.data import data_of
from tubecert.controller.folder import files_of, write
from tubecert.recheck.document import read
from tubecert.recheck.sampled_loop.exported import Exported, exported
from tubecert.recheck.sampled_loop.record import read_certificate
from tubecert.sampled_loop.file import certificate_text
from tubecert.sampled_loop.record import PlanKnots

WAVE = {"trajectory": handmade.WAVE % ""}
PLANS = {
    "rest": {},
    "wave": WAVE,
    "then rest": {"trajectory": handmade.WAVE % ", afterwards: rest", "afterwards": "rest", "hold": "left"},
    "again": {"trajectory": handmade.WAVE % ", afterwards: repeat", "afterwards": "repeat"},
    "family": {"trajectory": handmade.ANY},
    "knots": {"planned": handmade.held_knots(), "afterwards": "repeat"},
}
DATA = "controller_data.h"


def text_of(**options):
    return certificate_text(handmade.certificate(**options))


def examined(text, files):
    claims = list(Exported(read_certificate(read(text, "c.json")), files).claims())
    return next(
        (f"{name}: {own.why}" for name, own in claims if not own.holds), "" if len(claims) == 6 else "few"
    )


def files_for(**options):
    return {name: own.encode() for name, own in files_of(data_of(handmade.certificate(**options))).items()}


def sealed(data):
    """The data with the mark of what they are now: everybody can write it."""
    first, _, rest = data.partition(b"\n")
    digest = hashlib.sha256(rest).hexdigest().encode()
    return re.sub(rb"text sha256:[0-9a-f]{64}", b"text sha256:" + digest, first) + b"\n" + rest


@pytest.mark.slow
@pytest.mark.parametrize("arithmetic", ["double", "single"])
@pytest.mark.parametrize("z", [0, 2])
@pytest.mark.parametrize("options", PLANS.values(), ids=PLANS)
def test_what_export_writes_is_confirmed(options, z, arithmetic):
    own = {**options, "z": z, "arithmetic": arithmetic}
    assert examined(text_of(**own), files_for(**own)) == ""


@pytest.mark.slow
def test_cubics_through_linear_knots_are_confirmed():
    from fractions import Fraction as Q

    knots = PlanKnots(
        t=(Q(0), Q("0.07"), Q("0.2")),
        x=((Q(0), Q(0)), (Q("0.1"), Q("0.3")), (Q(0), Q("0.1"))),
        u=((Q(1),), (Q("0.3"),), (Q(-1),)),
        interpolation="linear",
    )
    assert examined(text_of(planned=knots), files_for(planned=knots)) == ""


def change(pattern, made):
    """The data with the first place of a pattern changed."""

    def changed(data):
        found, count = re.subn(pattern, made, data.decode(), count=1, flags=re.DOTALL)
        assert count == 1, pattern
        return found.encode()

    return changed


def swapped(data):
    """The plan's inputs one sample late."""
    head, _, rest = data.decode().partition("US[STEPS][NU] = {\n")
    rows, _, tail = rest.partition("};")
    lines = rows.splitlines(keepends=True)
    return f"{head}US[STEPS][NU] = {{\n{''.join([lines[0], *lines[:-1]])}}};{tail}".encode()


DIGIT = r"(= \{\n?(?:  \{)?-?0x1\.)([0-9a-f])"
MUTATIONS = [
    *((WAVE, change(rf"( {name}\[[^=]*){DIGIT}", lambda m: m[1] + m[2] + ("1" if m[3] != "1" else "2")))
      for name in "FGMN"),
    *((WAVE, change(rf"({name}\[[^=]*= \{{-?0x1\.)([0-9a-f])", lambda m: m[1] + ("1" if m[2] != "1" else "2")))
      for name in ("REACH", "MEMORY", "LOW", "HIGH")),
    *((WAVE, change(rf"( {name}\[STEPS\]\[..\] = \{{\n  \{{[^\n]*\n  \{{-?0x1\.....)([0-9a-f])",
      lambda m: m[1] + ("1" if m[2] != "1" else "2"))) for name in ("XS", "US")),
    *((WAVE, change(rf"({name}\[TESTS[^=]*= \{{\n  \{{-?0x1\.)([0-9a-f])",
      lambda m: m[1] + ("1" if m[2] != "1" else "2")))
      for name in ("TEST_U", "TEST_NEXT", "TEST_Y", "TEST_ZETA")),
    (WAVE, swapped),
    (WAVE, change(r"STEPS 51u", "STEPS 50u")),
    (WAVE, change(r"AFTER 51u", "AFTER 0u")),
    (WAVE, change(r"typedef double", "typedef float")),
    (WAVE, change(r"SAMPLE_TIME 0x1.4", "SAMPLE_TIME 0x1.5")),
    (WAVE, change(r"DELAY 0x1.4", "DELAY 0x1.5")),
    (WAVE, change(r"CERTIFICATE \"sha256:.", 'CERTIFICATE "sha256:g')),
    (WAVE, change(r"NZ 2", "NZ 1")),
    (WAVE, change(r"\{\n  \{([^,}]*), ([^}]*)\},\n  \{", r"{\n  {{\1, \2}},\n  {")),
    (WAVE, change(r"REACH\[NX\] = \{([^}]*)\}", r"REACH[NX] = {\n  {\1},\n}")),
    (WAVE, change(r"REACH\[NX\] = \{", "REACH[NX] = {0, ")),
    (WAVE, change(r"#endif\n$", "#endif\n#define STATUS_BAD 0\n")),
    (WAVE, change(r"(US\[STEPS\])", r"US[STEPS][NU] = {{0}};\nstatic const float \1")),
    ({}, change(r"(US\[STEPS\]\[NU\] = \{\n  \{0x1)p", r"\1.8p")),
    ({}, change(r"(XS\[STEPS\]\[NX\] = \{\n  \{)([^,]*), ([^}]*)", r"\1\3, \2")),
    ({}, change(r"(XS\[STEPS\]\[NX\] = \{\n  \{[^}]*)\}", r"\1, 0x0p+0f}")),
    (PLANS["again"], change(r"SAMPLE_TIME \+ 0x1\.e", "SAMPLE_TIME + 0x1.d")),
    (PLANS["again"], change(r"sin\(", "cos(")),
    (PLANS["again"], change(r"pow\(([^,]*), 2", r"pow(\1, 4")),
    (PLANS["again"], change(r"(  us\[0\])", r"  xs[0] = (real)0.0;\n\1")),
    (PLANS["again"], change(r"(  us\[0\])", r"  k = 7;\n\1")),
    (PLANS["family"], change(r"#endif\n#ifdef CONTROLLER_SELFTEST", "int k;\n#endif\n#ifdef CONTROLLER_SELFTEST")),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("options", "mutation"), MUTATIONS, ids=range(len(MUTATIONS)))
def test_a_change_of_the_data_is_refused_although_its_mark_is_right(options, mutation):
    text, files = text_of(**options), files_for(**options)
    changed = mutation(files[DATA])
    assert changed != files[DATA]
    assert examined(text, {**files, DATA: changed}), "the mark tells it"
    assert examined(text, {**files, DATA: sealed(changed)})


@pytest.mark.slow
@pytest.mark.parametrize("name", ["controller.c", "controller.h", "selftest.c", "README.txt", DATA])
def test_a_changed_a_missing_and_a_further_file_are_refused(name):
    text, files = text_of(), files_for()
    assert "controller: " in examined(text, {**files, name: files[name] + b" "})
    assert "missing" in examined(text, {other: own for other, own in files.items() if other != name})
    assert "none of its files" in examined(text, {**files, f"a_{name}": files[name]})
    removed = files["controller.c"].replace(b"status = STATUS_BAD", b"status |= 0")
    assert "runtime" in examined(text, {**files, "controller.c": sealed(removed)})


@pytest.mark.slow
@pytest.mark.parametrize(
    "other",
    [{"z": 1}, {"arithmetic": "single"}, {"hold": "left"}, {"controller": handmade.tables(2, 5)}],
    ids=str,
)
def test_code_of_another_certificate_is_refused(other):
    assert "the runtime" in examined(text_of(**WAVE), files_for(**(WAVE | other))), (
        "README tells its certificate"
    )
    files = files_for(**(WAVE | other)) | {"README.txt": files_for(**WAVE)["README.txt"]}
    hashes = [handmade.certificate(**own).hash.encode() for own in (WAVE | other, WAVE)]
    files[DATA] = sealed(files[DATA].replace(*hashes))
    assert examined(text_of(**WAVE), files)


@pytest.mark.slow
def test_links_and_pipes_are_not_read(tmp_path):
    certificate = read_certificate(read(text_of(), "c.json"))
    write(str(tmp_path / "c"), files_of(data_of(handmade.certificate())))
    assert all(own.holds for _, own in exported(certificate, str(tmp_path / "c")))
    (tmp_path / "c" / "controller.c").rename(tmp_path / "controller.c")
    (tmp_path / "c" / "controller.c").symlink_to(tmp_path / "controller.c")
    [(name, found)] = exported(certificate, str(tmp_path / "c"))
    assert (name, found.holds) == ("controller: the folder can be read", False)
    assert not exported(certificate, str(tmp_path / "nowhere"))[0][1].holds


@pytest.mark.slow
def test_the_command_tells_the_claims(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cart.certificate.json").write_text(text_of())
    assert run("export", "cart.certificate.json", "-o", "c").exit_code == 0
    done = run("recheck", "cart.certificate.json", "--controller", "c")
    assert "confirmed     controller: the limits are those of the certificate" in done.output
    (tmp_path / "c" / "selftest.c").write_text("")
    done = run("recheck", "cart.certificate.json", "--controller", "c")
    assert done.exit_code == 1
    assert "selftest.c is not what tubecert writes" in done.output

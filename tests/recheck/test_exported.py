"""`recheck --controller`: exported code is confirmed; what is changed in it is refused, with hashes made right."""

import json
import re
from fractions import Fraction as Q

import handmade
import pytest
from commands import run

from tubecert.controller.data import data_of
from tubecert.controller.folder import files_of, marked, write
from tubecert.recheck.document import read
from tubecert.recheck.sampled_loop.exported import compared, exported
from tubecert.sampled_loop.record import certificate_text
from tubecert.spec import Knots

WAVE = {"trajectory": handmade.WAVE % ""}
CUBICS = Knots(
    t=(Q(0), Q("0.07"), Q("0.2")),
    x=((Q(0), Q(0)), (Q("0.1"), Q("0.3")), (Q(0), Q("0.1"))),
    u=((Q(1),), (Q("0.3"),), (Q(-1),)),
    interpolation="linear",
)
PLANS = {
    "rest": {},
    "wave": WAVE,
    "then rest": {"trajectory": handmade.WAVE % ", afterwards: rest", "afterwards": "rest", "hold": "left"},
    "again": {"trajectory": handmade.WAVE % ", afterwards: repeat", "afterwards": "repeat"},
    "family": {"trajectory": handmade.ANY},
    "knots": {"planned": handmade.held_knots(), "afterwards": "repeat"},
    "cubics": {"planned": CUBICS},
}
DATA = "controller_data.h"


def text_of(**options):
    return certificate_text(handmade.certificate(**options))


def examined(text, files):
    """What is contradicted."""
    claims = list(compared(read(text, "c.json"), files))
    wrong = [f"{name}: {own.why}" for name, own in claims if not own.holds]
    return wrong[0] if wrong else "" if len(claims) == 3 else "few"


def files_for(**options):
    return files_of(data_of(handmade.certificate(**options)))


def sealed(data):
    """The data with the mark of what they are now: everybody can write it."""
    return marked(data.partition(b"\n")[2])


@pytest.mark.slow
@pytest.mark.parametrize("arithmetic", ["double", "single"])
@pytest.mark.parametrize("z", [0, 2])
@pytest.mark.parametrize("options", PLANS.values(), ids=PLANS)
def test_what_export_writes_is_confirmed(options, z, arithmetic):
    own = {**options, "z": z, "arithmetic": arithmetic}
    assert examined(text_of(**own), files_for(**own)) == ""


def late(found):
    """Rows one sample late."""
    rows = found[2].split(",\n")
    return found[1] + ",\n".join([rows[0], *rows[:-1]])


def other(found):
    """Another digit."""
    return found[1] + ("1" if found[2] != "1" else "2")


CHANGES = {  # of plans: patterns of what is found in the data, and what it becomes
    "wave": [
        *((rf"(\b{name}\[[^;]*?0x1\.)(.)", other)
          for name in ("F", "G", "M", "N", "REACH", "MEMORY", "LOW", "HIGH", "XS", "US")),
        *((rf"(define {name} .*?[1-9])([0-9])", other)
          for name in ("SAMPLE_TIME", "STEPS", "AFTER", "ROWS")),
        (r"(US\[ROWS\]\[NU\] = {)(.*?)(?=};)", late),
        (r"DELAY 0.005", "DELAY 0.006"),
        (r"LEAD 0.015", "LEAD 0.005"),
        (r"typedef double", "typedef float"),
        (r"(CERTIFICATE \"sha256:)(.)", other),
        (r"NZ 2", "NZ 1"),
        (r"REACH\[NX\] = {", "REACH[NX] = {0, "),
        (r"{({[^,}]*, [^}]*})", r"{{\1}"),
        (r"#endif\n$", "#endif\n#define STATUS_BAD 0\n"),
        (r"(US\[ROWS\])", r"US[ROWS][NU] = {{0}};\nstatic const float \1"),
        (r"(XS\[ROWS\]\[NX\] = {{[^}]*)}", r"\1, 0x0.0p+0}"),
        (r"(XS\[ROWS\]\[NX\] = {{[^}]*, 0x1\.)0", r"\g<1>0000000000001"),  # none of single precision
    ],
    "rest": [
        (r"(US\[ROWS\]\[NU\] = {{0x1\.)0", r"\g<1>8"),
        (r"(XS\[ROWS\]\[NX\] = {{)([^,]*), ([^}]*)", r"\1\3, \2"),
    ],
    "again": [
        (r"sin\(", "cos("),
        (r"(pow\(.*?, 0x1.)0", r"\g<1>8"),
        (r"(  us\[0\])", r"  k = 7;\n\1"),
        (r"(XS\[[^;]*?0x1\.)(.)", other),
    ],
    "family": [(r"\n#endif\n$", "\nint k;\n#endif\n"), (r"PLAN_HANDED", "PLAN_TABLE"), (r"(XS.*0x)0", r"\g<1>1")],
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("plan", CHANGES)
def test_a_change_of_the_data_is_refused_although_its_mark_is_right(plan):
    text, files = text_of(**PLANS[plan]), files_for(**PLANS[plan])
    for pattern, made in CHANGES[plan]:
        changed = re.sub(pattern, made, files[DATA].decode(), count=1, flags=re.DOTALL).encode()
        assert changed != files[DATA], pattern
        assert examined(text, {**files, DATA: changed}), "the mark tells it"
        assert examined(text, {**files, DATA: sealed(changed)}), pattern


@pytest.mark.slow
def test_a_formula_of_which_doubles_lose_more_than_is_allowed_is_refused():
    lost = PLANS["again"]["trajectory"].replace("cos(t)]", "cos(t) + (1e15 + sin(t)) - 1e15]")
    own = PLANS["again"] | {"trajectory": lost}
    assert "the plan of sample" in examined(text_of(**own), files_for(**own))


@pytest.mark.slow
@pytest.mark.parametrize("plan", ["wave", "again", "family", "cubics"])
def test_code_that_holds_what_is_proven_to_change_within_a_sample_is_refused(plan):
    """No export writes it, but anybody can: u* is then off by its rate times a sample, of which no row knows."""
    own = PLANS[plan] | {"hold": "continuous"}
    assert "within a sample" in examined(text_of(**own), files_for(**own))


@pytest.mark.slow
def test_a_changed_a_missing_and_a_further_file_are_refused():
    text, files = text_of(), files_for()
    for name in files:
        assert "controller: " in examined(text, {**files, name: files[name] + b" "})
        assert "missing" in examined(text, {other: own for other, own in files.items() if other != name})
        found = examined(text, {**files, f"a_{name}": files[name]})
        assert ("none of its files" in found) == name.endswith((".c", ".h")), "what was compiled is no source"
    taken = {**files, "controller.h.gch": b""}  # by gcc, in place of the header
    assert "none of its files" in examined(text, taken)
    removed = files["controller.c"].replace(b"status = STATUS_BAD", b"status |= 0")
    assert "runtime" in examined(text, {**files, "controller.c": sealed(removed)})
    advice = files["README.txt"].replace(b"without -ffast-math", b"with -ffast-math")
    assert "README.txt is not" in examined(text, {**files, "README.txt": sealed(advice)})


@pytest.mark.slow
@pytest.mark.parametrize("u", ["010*0*t", "0" + "+0" * 3_000, "-" * 3_000 + "t"])
def test_a_formula_that_python_does_not_read_is_refused(u):
    document = json.loads(text_of(**PLANS["again"]))
    document["result"]["spec"]["effective"]["trajectory"]["u"] = [u]
    assert "not as tubecert writes it" in examined(json.dumps(document), files_for(**PLANS["again"]))


@pytest.mark.slow
def test_a_name_that_would_be_a_line_of_the_note_is_refused():
    document = json.loads(text_of())
    document["result"]["spec"]["effective"]["name"] = "s\n    cc -ffast-math controller.c"
    assert "name" in examined(json.dumps(document), files_for())


@pytest.mark.slow
@pytest.mark.parametrize(
    "change",
    [{"z": 1}, {"arithmetic": "single"}, {"hold": "left"}, {"controller": handmade.tables(2, 5)}],
    ids=str,
)
def test_code_of_another_certificate_is_refused(change):
    files = files_for(**(WAVE | change))
    assert DATA in examined(text_of(**WAVE), files)
    hashes = [handmade.certificate(**own).hash.encode() for own in (WAVE | change, WAVE)]
    files |= {name: sealed(files[name].replace(*hashes)) for name in (DATA, "README.txt")}
    assert DATA in examined(text_of(**WAVE), files)


@pytest.mark.slow
def test_links_are_not_read(tmp_path):
    certificate, home = read(text_of(), "c.json"), tmp_path / "c"
    write(str(home), files_for())
    assert all(own.holds for _, own in exported(certificate, str(home)))
    (home / "controller.c").rename(tmp_path / "controller.c")
    (home / "controller.c").symlink_to(tmp_path / "controller.c")
    for folder in (home, tmp_path / "nowhere"):
        [(_, found)] = exported(certificate, str(folder))
        assert not found.holds


@pytest.mark.slow
def test_the_command_tells_the_claims(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cart.certificate.json").write_text(text_of())
    assert run("export", "cart.certificate.json", "-o", "c").exit_code == 0
    done = run("recheck", "cart.certificate.json", "--controller", "c", "-v")
    assert re.search("confirmed +controller: the plan is that of the certificate", done.output)
    assert re.search("confirmed .*", done.output)[0].split()[1] == "controller:", (
        "what was asked for comes first"
    )
    done = run("recheck", "cart.certificate.json", "--controller", "nofolder")
    assert done.exit_code == 2
    assert "TC100: cannot read 'nofolder': no such file or directory" in done.output
    (tmp_path / "c" / "selftest.c").write_text("")
    done = run("recheck", "cart.certificate.json", "--controller", "c")
    assert done.exit_code == 1
    assert "selftest.c is not what tubecert writes" in " ".join(done.output.split())

"""Texts of others are shown as they are, and steer nothing: terminals, workflows, pages, shells."""

import contextlib
import copy
import json
import os
import re
import shlex
from io import StringIO
from pathlib import Path

import certificates
import pytest
from commands import run
from hypothesis import given, settings
from hypothesis import strategies as st
from markdown_it import MarkdownIt
from rich.text import Text
from systems import SMALL
from texts import ROOT

from tubecert.certificate import dump, seal
from tubecert.certificate.result import Certificate
from tubecert.checking import Checked
from tubecert.checking.expectations import Claim
from tubecert.cli.check import FORMATS, written
from tubecert.errors import ExitCode
from tubecert.findings import Finding, Location, Severity
from tubecert.printable import blanked, harmless, printable_json, visible
from tubecert.report import html, markdown
from tubecert.report.certificate_page import page_of
from tubecert.report.page import typeset
from tubecert.report.terminal import Terminal

NASTY = st.text(
    st.characters(exclude_categories=["Cs"])
    | st.sampled_from("\x1b\x07\r\n\x9b\u202e\u2028\x00:#[]|`*\udcff"),
    max_size=40,
)
STARTS = st.sampled_from(
    ["", "::error::", "  ::set-env name=a::b", "##[command]", "x ##vso[task]", "\x1b[2J", "\n::stop"]
)
FOREIGN = st.builds(str.__add__, STARTS, NASTY)
COMMAND = re.compile(r"\s*::|.*##\w*\[")

pytestmark = pytest.mark.usefixtures("folder")


def is_clean(text: str) -> bool:
    """Whether nothing but line breaks is there that does not print, and no line is a command."""
    lines = text.split("\n")
    return all(line.isprintable() for line in lines) and not any(COMMAND.match(line) for line in lines)


@given(FOREIGN)
def test_a_visible_text_is_one_line_that_prints(text):
    assert visible(text).isprintable()
    assert visible(visible(text)) == visible(text)
    assert visible(text) == text or not text.isprintable()
    assert is_clean(harmless(visible(text)))


@given(FOREIGN)
def test_a_blanked_text_keeps_its_columns(text):
    assert len(blanked(text)) == len(text)
    assert blanked(text).isprintable()


def test_what_does_not_print_is_named():
    assert visible("a\x1b[1m\n\u202e\udcff\U000e0001é") == r"a\x1b[1m\n\u202e\udcff\U000e0001é"
    assert harmless("::a") == r":\x3aa"
    assert harmless("##[a] ##vso[b] # ## c") == r"#\x23[a] #\x23vso[b] # ## c"


@pytest.mark.slow
@given(st.recursive(FOREIGN, lambda inner: st.lists(inner) | st.dictionaries(FOREIGN, inner), max_leaves=8))
def test_printable_json_says_the_same(data):
    text = printable_json(json.dumps(data, indent=1, ensure_ascii=False))
    assert text.replace("\n", "").isprintable()
    text.encode()
    assert json.loads(text) == data


@given(FOREIGN, st.sampled_from(["always", "never"]))
def test_a_terminal_gets_no_command(text, color):
    terminal = Terminal.of(StringIO(), color, {})
    shown = terminal.text([Text(f"{text} x", style="bold")])
    assert is_clean(re.sub(r"\x1b\[[0-9;]*m", "", shown))


def checked(text: str) -> list[Checked]:
    place = Location(file=text.replace("\0", "") or "f", line=1, column=3, source=text, width=2)
    findings = tuple(
        Finding(code="TC109", message=text, location=place, help=text, severity=severity)
        for severity in Severity
    )
    claims = (Claim(name=text, verdict=text, message=text),)
    return [Checked(path=place.file, findings=findings, code=ExitCode.INVALID, claims=claims)]


@pytest.mark.slow
@settings(max_examples=80, deadline=None)
@given(FOREIGN)
def test_no_format_passes_on_what_does_not_print(text):
    for name in FORMATS:
        shown = written(name, checked(text), Terminal.of(StringIO(), "never", {}))
        lines = shown.split("\n")
        assert all(line.isprintable() for line in lines), name
        commands = [line for line in lines if COMMAND.match(line)]
        if name == "github":
            assert len(commands) == 3
            assert all(re.match(r"::(error|warning|notice) file=", line) for line in commands)
        elif name == "text":
            assert not commands
        shown.encode()


def test_a_name_of_a_file_is_no_command():
    name = "::set-output name=x::\x1b]0;gone\x07.yaml"
    Path(name).write_text("a: [")
    done = run("check", name)
    assert done.exit_code == 2
    assert is_clean(done.output)
    Path("a.yaml").write_text("##[add-matcher]x: [\n::stop-commands::x: ]\n")
    assert is_clean(run("check", "a.yaml").output)


@pytest.mark.parametrize(
    "arguments", [["--\x1b[2Jx"], ["certify", "a", "\x1b[2J"], ["::error::x"], ["certify", "--gap", "\x1b"]]
)
def test_the_command_line_is_shown_as_it_prints(arguments, capfd):
    from tubecert.cli import app as commands

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sys.argv", ["tubecert", *arguments])
        assert commands.start() == 2
    assert is_clean(capfd.readouterr().err)


def planted(text: str, *path: str) -> dict:
    result = copy.deepcopy(certificates.certified())
    inner = result
    for key in path[:-1]:
        inner = inner[int(key) if key.isdigit() else key]
    inner[path[-1]] = text
    return seal(result, {"command": "tubecert certify"})


PLACES = [
    ("spec", "effective", "name"),
    ("reasons", "0", "verdict"),
    ("reasons", "0", "message"),
    ("overrides", "x"),
]


@pytest.mark.slow
@pytest.mark.parametrize("path", PLACES, ids=".".join)
@pytest.mark.parametrize("text", ["a\nconfirmed b: the certificate says certified", "\x1b[2J", "\u202ex"])
def test_a_certificate_holds_no_character_that_does_not_print(path, text):
    Path("c.json").write_text(dump(planted(text, *path)))
    for command in (
        ["report", "c.json"],
        ["simulate", ROOT / "configs/three_state.yaml", "--certificate", "c.json"],
    ):
        done = run(*command)
        assert (done.exit_code, "TC601" in done.output) == (2, True)
        assert is_clean(done.output)
    assert is_clean(run("recheck", "c.json").output)


@pytest.mark.parametrize("member", ["hash", "name\x1b[31m", "a\nconfirmed"])
def test_recheck_shows_unknown_members_and_the_hash_on_lines_of_their_own(member):
    sealed = seal(certificates.certified(), {})
    sealed[member] = "sha256:0\n\x1b[32mconfirmed c.json: the certificate says certified"
    sealed["result"][member] = sealed[member]
    Path("c.json").write_text(json.dumps(sealed))
    output = run("recheck", "c.json").output
    assert is_clean(output)
    assert not any(line.startswith("confirmed") for line in output.splitlines())


@pytest.mark.parametrize("render", [html.render_page, markdown.render_page])
def test_the_line_to_copy_is_one_command_of_the_shell(render):
    name = "x'; touch hurt; echo $(id) `id` \"&"
    page = render(page_of(Certificate.from_json(planted(name, "spec", "effective", "name"))))
    import html as escapes

    lines = (re.sub(r"</?pre>", "", line).strip() for line in escapes.unescape(page).splitlines())
    commands = [line for line in lines if line.startswith("tubecert recheck") and "--spec" not in line]
    assert [shlex.split(line) for line in commands] == [["tubecert", "recheck", "CERT.json"]]


MARKUP = st.text(st.sampled_from("#*-+=_~`<>|[]()!&$\\ \t1.2)a:/w@\n") | st.characters(), max_size=30)


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@given(MARKUP)
def test_markdown_shows_a_text_as_it_is(text):
    tokens = MarkdownIt("commonmark").enable(["table", "strikethrough"]).parse(markdown.escape(text))
    wanted = " ".join(visible(" ".join(typeset(text).split())).split())
    if not wanted:
        assert not tokens
        return
    assert [token.type for token in tokens] == ["paragraph_open", "inline", "paragraph_close"]
    assert {child.type for child in tokens[1].children} <= {"text", "text_special"}
    assert "".join(child.content for child in tokens[1].children) == wanted


@pytest.mark.slow
@settings(max_examples=50, deadline=None)
@given(MARKUP)
def test_nothing_in_a_certificate_is_markup_of_its_page(text):
    plain = markdown.render_page(page_of(Certificate.from_json(planted("x", *PLACES[0]))))
    page = markdown.render_page(page_of(Certificate.from_json(planted(visible(text), *PLACES[0]))))
    parser = MarkdownIt("commonmark")
    count = [sum(token.type == "heading_open" for token in parser.parse(each)) for each in (plain, page)]
    assert count[0] == count[1]
    assert "html_block" not in {token.type for token in parser.parse(page)}


@pytest.mark.usefixtures("barely")
@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="file names are text there")
def test_names_that_are_not_utf_8_work():
    def name(data: bytes) -> str:
        return os.fsdecode(data)

    Path(name(b"a\xff.yaml")).write_text(SMALL)
    out = name(b"c\xff.json")
    pages = ["--report", name(b"p\xff.html"), "--report", name(b"p\xff.md")]
    assert run("certify", name(b"a\xff.yaml"), "-o", out, *pages).exit_code == 0
    assert run("report", out, "-o", name(b"r\xff.html")).exit_code == 0
    assert json.loads(run("report", out, "--json").stdout)["pages"] == [name(b"c\xff.html")]
    assert run("recheck", out, "--spec", name(b"a\xff.yaml"), "-q").exit_code == 0
    assert run("init", name(b"i\xff.yaml")).exit_code == 0
    metric = name(b"m\xff.json")
    assert run("synth", name(b"a\xff.yaml"), "--rate", "0.5", "-o", metric).exit_code == 0
    assert run("certify", name(b"a\xff.yaml"), "--metric", metric, "--rho-a", "0.02").exit_code in (0, 1)
    Path(name(b"bad\xff.yaml")).write_text("a: [")
    for format_ in FORMATS:
        done = run("check", name(b"bad\xff.yaml"), "--format", format_)
        assert done.exit_code == 2
        done.output.encode()
    with contextlib.suppress(FileNotFoundError):
        assert not list((Path("..") / "state").rglob("*.log"))


def test_a_plan_has_a_name_that_prints():
    text = (ROOT / "configs" / "three_state.yaml").read_text()
    start = text.index("trajectory:")
    end = text.index("\n", start)
    Path("s.yaml").write_text(text[:start] + 'trajectory: {kind: csv, file: "a\\e[31m.csv"}' + text[end:])
    done = run("check", "s.yaml")
    assert (done.exit_code, "TC111" in done.output) == (2, True)

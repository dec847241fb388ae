"""Pages as a reader sees them: parsed strictly, in text and in a browser."""

import json
import re
import shutil
import subprocess
import xml.etree.ElementTree as ET
from html.parser import HTMLParser

VOID = {"meta", "link", "br", "hr", "img", "input"}
BROWSERS = ("chromium", "chromium-browser", "google-chrome")

# what a test copy of a page tells about itself, in the page
_PROBE = """<script>
addEventListener("load", () => {
  const box = e => { const r = e.getBoundingClientRect(); return [r.left, r.top, r.right, r.bottom]; };
  const lines = e => {
    const range = document.createRange();
    range.selectNodeContents(e);
    return range.getClientRects().length;
  };
  const found = {
    width: innerWidth,
    client: document.documentElement.clientWidth,
    scroll: document.documentElement.scrollWidth,
    background: getComputedStyle(document.body).backgroundColor,
    figures: [...document.querySelectorAll("figure > svg")].map(svg => ({
      box: box(svg),
      texts: [...svg.querySelectorAll("text")].map(t => [t.textContent, ...box(t)]),
      marks: [...svg.querySelectorAll(".curve, .dot, .sweep, .bar, .tube")].map(box),
    })),
    heads: [...document.querySelectorAll("th")].map(
      th => [th.textContent, getComputedStyle(th.closest("thead")).position, lines(th)]),
    sizes: [...document.querySelectorAll("figure > svg text.tick")].map(
      t => parseFloat(getComputedStyle(t).fontSize) * t.getScreenCTM().a),
  };
  parent.postMessage(JSON.stringify(found), "*");
});
</script>"""

# a browser's window has a least width, a frame has none
_FRAME = """<!DOCTYPE html><style>body {{ margin: 0 }}</style>
<script>addEventListener("message", e => {{
  const out = document.createElement("pre");
  out.id = "probe";
  out.textContent = e.data;
  document.body.append(out);
}});</script>
<iframe src="{source}" width="{width}" height="900" frameborder="0"></iframe>"""


class Page(HTMLParser):
    """Every tag closed in its order; `text` is what is read, `tags` what there is, `drawings` the figures as XML."""

    def __init__(self, source: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.tags: list[str] = []
        self.attributes: list[tuple[str, str | None]] = []
        self.texts: list[str] = []
        self.styles = ""
        self.feed(source)
        self.close()
        assert not self.open, f"never closed: {self.open}"
        self.drawings = [ET.fromstring(text) for text in re.findall(r"<svg.*?</svg>", source, re.DOTALL)]

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        self.attributes += attributes
        names = [name for name, _ in attributes]
        assert len(names) == len(set(names)), f"<{tag}> has an attribute twice"
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.tags.append(tag)
        self.attributes += attributes

    def handle_endtag(self, tag):
        assert self.open[-1:] == [tag], f"</{tag}> closes {self.open[-1:]}"
        self.open.pop()

    def handle_data(self, data):
        if self.open[-1:] == ["style"]:
            self.styles += data
        else:
            self.texts.append(data)

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.texts).split())

    def values(self, name: str) -> list[str]:
        return [value or "" for key, value in self.attributes if key == name]


def browser() -> str | None:
    """A browser on PATH."""
    return next(filter(None, map(shutil.which, BROWSERS)), None)


def _run(folder, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [
        browser() or "chromium",
        "--headless=new",
        "--no-sandbox",
        "--disable-gpu",
        "--hide-scrollbars",
        "--no-first-run",
        "--disable-dev-shm-usage",
        f"--user-data-dir={folder / 'profile'}",
        *arguments,
    ]
    return subprocess.run(command, capture_output=True, text=True, timeout=90, check=True)


def _looks(width: int, height: int, dark: bool) -> tuple[str, ...]:
    return f"--window-size={width},{height}", f"--blink-settings=preferredColorScheme={0 if dark else 1}"


def console_of(paths, folder) -> list[str]:
    """What the browser complains about when it opens the pages as they are."""
    frames = folder / "frames.html"
    frames.write_text("".join(f'<iframe src="{path.as_uri()}"></iframe>' for path in paths), encoding="utf-8")
    done = _run(folder, "--enable-logging=stderr", "--log-level=0", "--dump-dom", frames.as_uri())
    return [line for line in done.stderr.splitlines() if "CONSOLE" in line]


def measure(path, folder, *, width: int, dark: bool = False) -> dict:
    """The page's layout at a width in CSS pixels, from a copy that may run the probe."""
    source = path.read_text(encoding="utf-8")
    policy = re.search(r'<meta http-equiv="Content-Security-Policy"[^>]*>', source)
    copy = folder / f"probe-{path.name}"
    copy.write_text(source.replace(policy[0], "").replace("</head>", f"{_PROBE}</head>"), encoding="utf-8")
    frame = folder / f"frame-{path.name}"
    frame.write_text(_FRAME.format(source=copy.name, width=width), encoding="utf-8")
    looks = _looks(max(width, 600), 900, dark)
    dom = _run(folder, *looks, "--virtual-time-budget=3000", "--dump-dom", frame.as_uri()).stdout
    found = re.search(r'<pre id="probe">(.*?)</pre>', dom, re.DOTALL)
    assert found, "the probe did not run"
    parser = HTMLParser(convert_charrefs=True)
    texts: list[str] = []
    parser.handle_data = texts.append
    parser.feed(found[1])
    parser.close()
    return json.loads("".join(texts))

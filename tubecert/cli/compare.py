"""`compare`: certificates in; what they say side by side, as a table, a page or data."""

from __future__ import annotations

from collections.abc import Sequence

from tubecert import certificate
from tubecert.cli.guard import write_stdout
from tubecert.cli.options import Output
from tubecert.cli.presenting import present
from tubecert.cli.targets import refused, spare
from tubecert.files import STDIN
from tubecert.library.comparing import FORMATS, REMEDY, compare, ending_of
from tubecert.report.comparison import page_of


def run(paths: Sequence[str], format_: str, targets: Sequence[str], output: Output) -> None:
    """Compare, write what was asked for. Raises `TargetError` for a certificate that cannot be read."""
    if list(paths).count(STDIN) > 1:
        raise refused("- is given twice: one certificate can be on stdin", "give files")
    for target in targets:
        ending_of(target)
        certificate.check_target(target, REMEDY)
        spare(target, {f"certificate {path}": path for path in paths if path != STDIN})
    comparison = compare(*paths)
    for target in targets:
        comparison.save(target)
    if format_ == "text":
        written = [*(("page", target) for target in targets), ("more", "-v here; -o FILE.html")]
        present(output, page_of(comparison.sides), written)
    else:
        write_stdout(FORMATS[f".{format_}"](comparison))

"""The commands around a certification: check, schema, init, explain, version. `register` adds them to the app."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer

from tubecert.cli.clusters import Scheduler
from tubecert.cli.guard import guarded
from tubecert.cli.options import Debug, Ending, Output, Settings, with_output

_CHECK_AFTER = """\b
Examples:
  tubecert check plant.yaml
  tubecert check configs/ other.yaml --strict
  tubecert check configs/ --certify --jobs 4 --format junit > report.xml

\b
In a workflow of GitHub (GITHUB_ACTIONS=true) findings become annotations, and a summary of the step.
Exit codes: 0 nothing to complain about; 1 errors in the mathematics, or not as expected; 2 invalid
files; 4 undecided.
"""

_SCHEMA_AFTER = """\b
Example:
  tubecert schema spec > spec.schema.json
and, as the first line of a specification:
  # yaml-language-server: $schema=spec.schema.json
"""

_INIT_AFTER = """\b
Example:
  tubecert init plant.yaml --template tracking && tubecert certify plant.yaml
"""

_EXPLAIN_AFTER = """\b
Examples:
  tubecert explain TC302
  tubecert explain feedback_gain
  tubecert explain 26c
"""

_VERSION_AFTER = """\b
Example:
  tubecert version --json
"""


class Format(StrEnum):
    """What findings are written as."""

    TEXT = "text"
    JSON = "json"
    GITHUB = "github"
    JUNIT = "junit"
    SARIF = "sarif"


class Schema(StrEnum):
    """What a schema describes."""

    SPEC = "spec"
    METRIC = "metric"
    CERTIFICATE = "certificate"
    SAMPLED_LOOP = "sampled-loop"


class Template(StrEnum):
    """What to start from."""

    REGULATION = "regulation"
    TRACKING = "tracking"
    MACHINE = "machine"
    PVTOL = "pvtol"
    CAR = "car"
    CRANE = "crane"
    ARM2 = "arm2"
    QUADROTOR = "quadrotor"
    CSV = "csv"


_Specs = Annotated[
    list[str],
    typer.Argument(metavar="SPEC", help="Specifications, or folders with some.", show_default=False),
]


@with_output
def check(
    context: typer.Context,
    specs: _Specs,
    *,
    format_: Annotated[
        Format | None, typer.Option("--format", help="What to write.  [text; github in its workflows]")
    ] = None,
    certify: Annotated[
        bool, typer.Option("--certify", help="Certify, too, and compare with the file's expect.")
    ] = False,
    family: Annotated[
        str | None,
        typer.Option(
            metavar="FILE",
            help="Whether plans (CSV, or specifications) are of this family.",
        ),
    ] = None,
    strict: Annotated[bool, typer.Option("--strict", help="Warnings are errors.")] = False,
    skip_others: Annotated[
        bool, typer.Option("--skip-others", help="Leave YAML files that are no specifications alone.")
    ] = False,
    set_: Settings = None,
    jobs: Annotated[str, typer.Option(metavar="NUMBER", help="Files checked at a time.")] = "1",
    scheduler: Scheduler = None,
    no_cache: Annotated[
        bool, typer.Option("--no-cache", help="Do not use what earlier checks have found.")
    ] = False,
    gap: Annotated[str, typer.Option(metavar="NUMBER", help="As for certify; with --certify.")] = "1/100",
    deadline: Ending = None,
    budget: Annotated[
        str | None, typer.Option(metavar="NUMBER", help="As for certify; with --certify.")
    ] = None,
    how: Output,
) -> None:
    """Check specifications: format, mathematics, what is odd; with --certify also the locked results.

    Nothing is written but the findings; what files are found to be is remembered, so that a file that has not
    changed costs nothing.
    """
    if how.json and format_ not in (None, Format.JSON):
        raise typer.BadParameter("--json and --format exclude each other", ctx=context)
    with guarded(how, deadline):
        from tubecert.cli.check import Given, run

        given = Given(
            paths=specs,
            format=None if format_ is None else str(format_),
            certify=certify,
            family=family,
            strict=strict,
            skip_others=skip_others,
            settings=set_ or (),
            jobs=jobs,
            scheduler=scheduler,
            no_cache=no_cache,
            gap=gap,
            budget=budget,
        )
        code = run(given, how)
    raise typer.Exit(code)


def schema(
    context: typer.Context,
    name: Annotated[
        Schema,
        typer.Argument(metavar="spec|metric|certificate|sampled-loop", help="Of what.", show_default=False),
    ] = Schema.SPEC,
    *,
    debug: Debug = False,
) -> None:
    """Show a JSON Schema: of specifications (for editors), of metric files, of certificates, of those with hardware."""
    with guarded(Output(debug=debug)):
        from tubecert.cli.schema import run

        run(str(name))


def init(
    context: typer.Context,
    file: Annotated[
        str | None,
        typer.Argument(
            metavar="FILE", help="The new file; - is stdout.  [TEMPLATE.yaml]", show_default=False
        ),
    ] = None,
    *,
    template: Annotated[
        Template, typer.Option("--template", "-t", help="What to start from.")
    ] = Template.REGULATION,
    output: Annotated[
        str | None,
        typer.Option("--output", "-o", metavar="FILE", help="The same as FILE."),
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Say nothing.")] = False,
    debug: Debug = False,
) -> None:
    """Write a commented specification to start from; it certifies as it is. Nothing is overwritten."""
    if file is not None and output is not None:
        raise typer.BadParameter(f"FILE and --output name the same: give {file} or {output}", ctx=context)
    if file in tuple(Template):
        raise typer.BadParameter(f"{file} is a template: write --template {file}", ctx=context)
    with guarded(Output(debug=debug)):
        from tubecert.cli.init import run

        run(str(template), output if file is None else file, quiet=quiet)


def explain(
    context: typer.Context,
    topic: Annotated[
        str | None,
        typer.Argument(metavar="TOPIC", help="A code, a constant or an equation.", show_default=False),
    ] = None,
    *,
    debug: Debug = False,
) -> None:
    """Explain a finding code, a constant or an equation; without a topic, list all that there are."""
    with guarded(Output(debug=debug)):
        from tubecert.cli.explain import run

        run(topic)


@with_output
def show_version(context: typer.Context, *, how: Output) -> None:
    """Show the version; with -v, also those of Python and of the libraries that results rest on."""
    with guarded(how):
        from tubecert.cli.version import run

        run(how)
    raise typer.Exit(0)


def register(app: typer.Typer) -> None:
    """Adds the commands."""
    app.command("check", epilog=_CHECK_AFTER, short_help="Check specifications, for you and for CI.")(check)
    app.command("init", epilog=_INIT_AFTER, short_help="Write a specification to start from.")(init)
    app.command("schema", epilog=_SCHEMA_AFTER, short_help="Show the JSON Schemas.")(schema)
    app.command("explain", epilog=_EXPLAIN_AFTER, short_help="Explain a code, a constant, an equation.")(
        explain
    )
    app.command("version", epilog=_VERSION_AFTER, short_help="Show the version.")(show_version)

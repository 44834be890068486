"""`surehold campaign`: many runs of a plan, their report, and the plans there are."""

import time
from pathlib import Path
from typing import Annotated, Any

import typer

from surehold.amounts import amount

__all__ = ["campaigns"]

Only = Annotated[
    str, typer.Option(help="Problems and methods of the plan, separated by commas; by default all.", show_default=False)
]


def campaigns() -> typer.Typer:
    """Return the group of commands."""
    group = typer.Typer(
        help="Run plans of many runs, compare methods, and report beside the published numbers.",
        no_args_is_help=True,
        rich_markup_mode=None,
    )
    group.command()(run)
    group.command()(report)
    group.command("list")(show_plans)
    return group


def run(
    plan: Annotated[str, typer.Argument(help="A shipped plan (see `campaign list`), FILE.yaml or FILE.py:FUNCTION.")],
    runs: Annotated[int | None, typer.Option(help="Seeds of each problem and method; by default the plan's.")] = None,
    workers: Annotated[int, typer.Option(help="Processes.")] = 1,
    out: Annotated[str, typer.Option(help="Folder of the table; by default runs/campaigns/PLAN.")] = "",
    shard: Annotated[str, typer.Option(help="A share of the runs, such as 2/8, for several machines.")] = "1/1",
    backend: Annotated[
        str, typer.Option(help="loky (this machine), dask (a cluster on it), or dask://HOST:PORT (one that is there).")
    ] = "loky",
    only: Only = "",
    retry: Annotated[bool, typer.Option("--retry", help="Make runs again that failed.")] = False,
) -> None:
    """Make the runs of a plan that its table does not hold yet; Ctrl-C keeps what is finished.

    Exit code 1: some of its runs failed.
    """
    from surehold.campaigns.plan import share_of
    from surehold.campaigns.plan_file import load_plan
    from surehold.campaigns.runner import run_campaign
    from surehold.cli.terminal import terminal

    chosen = load_plan(plan)
    share = share_of(shard)
    folder = Path(out) if out else folder_of(chosen.name)
    console = terminal()
    display = Display(console, folder)
    try:
        with display:
            records = run_campaign(
                chosen,
                folder,
                runs=runs,
                workers=workers,
                backend=backend,
                shard=share,
                only=_labels(only),
                retry=retry,
                observer=display.show,
            )
    except KeyboardInterrupt:
        console.print(
            f"Interrupted after {display.done} of {display.total} runs; they are kept in {folder}. The same command "
            "continues.",
            markup=False,
        )
        raise typer.Exit(130) from None
    for note in records.notes:
        console.print(f"Note: {note}", markup=False, soft_wrap=True)
    if records.failed:
        (problem, method, seed), row = next(iter(records.failed.items()))
        reason = row["error"].rstrip(".")
        console.print(
            f"{amount(len(records.failed), 'run')} failed; the first: {method} on {problem}, seed {seed}: {reason}. "
            "Make them again with --retry.",
            markup=False,
            soft_wrap=True,
        )
    console.print(
        f"{amount(len(records.done), 'run')} in {folder}. Compare them: surehold campaign report {folder}",
        markup=False,
        soft_wrap=True,
    )
    if records.failed:
        raise typer.Exit(1)


def report(
    tables: Annotated[
        list[str] | None,
        typer.Argument(
            help="Folders of tables, or plans whose tables are in runs/campaigns; by default every folder there."
        ),
    ] = None,
    out: Annotated[str, typer.Option(help="Folder of the page and the CSVs; by default runs/campaigns.")] = "",
    illustrations: Annotated[
        bool, typer.Option(help="Also draw the figures that need no runs, and the grasps in 3-D.")
    ] = True,
    open_report: Annotated[bool, typer.Option("--open", help="Open the page in the browser at the end.")] = False,
) -> None:
    """Write one page and CSVs: every published number beside ours, every figure redrawn, a verdict for each row."""
    from surehold.campaigns.report import write_report
    from surehold.cli.terminal import terminal

    folders = [table_of(text) for text in tables or []] or known_folders()
    console = terminal()
    page = write_report(folders, out or CAMPAIGNS, illustrations=illustrations, say=lambda text: console.print(text))
    console.print(f"Report: {page}", markup=False, soft_wrap=True)
    if open_report:
        import webbrowser

        webbrowser.open(page.resolve().as_uri())


def show_plans() -> None:
    """Show the shipped plans, and how many runs are made of each."""
    from rich.table import Table

    from surehold.campaigns.plan_file import load_plan, shipped_plans
    from surehold.campaigns.table import read_folder
    from surehold.cli.terminal import terminal
    from surehold.errors import InputError

    table = Table(show_edge=False, pad_edge=False, header_style="bold")
    for column in ("plan", "runs made", "of", "what"):
        table.add_column(column, overflow="fold")
    for name in shipped_plans():
        plan = load_plan(name)
        try:
            made = str(len(read_folder(folder_of(name)).done))
        except InputError:
            made = "–"
        table.add_row(name, made, str(len(plan.tasks())), plan.title)
    terminal().print(table)


CAMPAIGNS = Path("runs") / "campaigns"


def folder_of(name: str) -> Path:
    """Return the default folder of a plan's table."""
    return CAMPAIGNS / name


def table_of(text: str) -> Path:
    """Return the folder or file of a table that is named so, or by its plan."""
    path = Path(text)
    if path.suffix in (".yaml", ".yml"):  # as it was given to `campaign run`
        return folder_of(path.stem)
    return path if path.exists() else folder_of(text)


def known_folders() -> list[Path]:
    """Return the default folders that hold a table.

    Raises
    ------
    InputError
        If there is none.
    """
    from surehold.errors import InputError

    found = sorted({path.parent for path in CAMPAIGNS.glob("*/table*.jsonl*")})
    if not found:
        raise InputError(f"'{CAMPAIGNS}' holds no table; run a plan first, such as surehold campaign run table-4.1.")
    return found


class Display:
    """Progress with remaining time on a terminal; a line now and then elsewhere."""

    def __init__(self, console: Any, folder: Path):
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

        self.total = self.done = 0
        self._console = console
        self._folder = folder
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(bar_width=None),
            MofNCompleteColumn(),
            TextColumn("{task.fields[failed]}"),
            TimeElapsedColumn(),
            TextColumn("remaining {task.fields[remaining]}"),
            console=console,
            transient=not console.is_terminal,
        )
        self._task: Any = None
        self._said = 0.0

    def __enter__(self) -> "Display":
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def show(self, progress: Any, row: dict[str, Any] | None) -> None:
        """Take in the state after a run."""
        self.total, self.done = progress.total, progress.done
        remaining = duration(progress.remaining_seconds)
        failed = f"{progress.failed} failed" if progress.failed else ""
        if self._task is None:
            self._task = self._progress.add_task("runs", total=progress.total, failed="", remaining=remaining)
            if progress.done:
                self._console.print(f"{progress.done} of {progress.total} runs are in {self._folder} already.")
        name = "runs" if row is None else f"{row['problem']}, {row['method']}, seed {row['seed']}"
        self._progress.update(self._task, completed=progress.done, description=name, failed=failed, remaining=remaining)
        now = time.monotonic()
        if row is not None and not self._console.is_terminal and now - self._said > 20.0:
            self._said = now
            self._console.print(f"{progress.done} of {progress.total} runs {failed} remaining {remaining}")


def duration(seconds: float | None) -> str:
    """Return a time as people say it.

    Examples
    --------
    >>> duration(4000.0), duration(75.0), duration(None)
    ('1 h 06 min', '1 min 15 s', '?')
    """
    if seconds is None:
        return "?"
    whole = round(seconds)
    if whole >= 3600:
        return f"{whole // 3600} h {whole % 3600 // 60:02d} min"
    return f"{whole // 60} min {whole % 60:02d} s" if whole >= 60 else f"{whole} s"


def _labels(text: str) -> list[str]:
    return [label.strip() for label in text.split(",") if label.strip()]

"""A study, as the library has it: its cells are forecast, run, and given as a table."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from tilestamp.experiments.studies import cells, forecast, runner, study_views
from tilestamp.experiments.studies.axes import Choice
from tilestamp.experiments.studies.design import Design
from tilestamp.experiments.studies.parameters import Resolver

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes


class Study(Design):
    """A design that can be run: see ``Design`` for its parameters."""

    def __repr__(self) -> str:
        """Say in a line how many cells of which axes it has."""
        return f"<Study: {study_views.heading(self)}>"

    def _repr_html_(self) -> str:
        """What is stored of its table, for a notebook."""
        return study_views.card(self, self.table)

    def plot(
        self, kind: study_views.Kind = "lines", number: str = "milliseconds", *, x: str = "", axes: "Axes | None" = None
    ) -> "Axes":
        """Draw a number of the stored cells over the axes.

        Parameters
        ----------
        kind : {"lines", "map"}
            Over one axis, a line for each place on the others; or over two axes, as colours.
        number : str
            A column of the table.
        x : str
            The axis to draw over; the first one of numbers if not given.
        axes : matplotlib Axes, optional
            To draw on; those of a new figure if not given.

        Raises
        ------
        TilestampError
            No such plot, axis or number; no cell is stored; a map of more or less than two axes.
        """
        return study_views.draw(self, self.table(), kind, number, x, axes)

    def forecast(self, jobs: int | None = None, resolver: Resolver | None = None) -> forecast.Forecast:
        """Say what a run would do: cells, executions, seconds; see ``run``."""
        return forecast.forecast(self, resolver or Resolver(), jobs)

    def run(
        self,
        jobs: int | None = None,
        cluster: str | None = None,
        say: Callable[[str], None] = lambda _: None,
        resolver: Resolver | None = None,
    ) -> runner.Summary:
        """Run what is not stored.

        Parameters
        ----------
        jobs : int, optional
            Processes; as many as the forecast is worth if not given.
        cluster : str, optional
            ``local``, or a scheduler of dask.distributed, ``tcp://HOST:8786``.
        say : callable
            Told how far it is.
        resolver : Resolver, optional
            Of an earlier call of the same study: no cell is resolved twice. What it read (scenes, machines, sources)
            is not read again.

        Raises
        ------
        TilestampError
            What is wrong with the study, the store or the workers; what was stored is safe.
        """
        return runner.run_study(self, jobs, cluster, say, resolver or Resolver())

    def table(self, resolver: Resolver | None = None) -> "pd.DataFrame":
        """All cells of this study that are stored, in its order: a column an axis, a column a number; see ``run``."""
        return cells.table(self, resolver or Resolver())

    def at(self, points: Sequence[Mapping[str, Any]], jobs: int | None = 1) -> "pd.DataFrame":
        """Run cells that are no part of the axes, and give their rows, in order: for whoever searches, asks and tells.

        Parameters
        ----------
        points : sequence of mappings
            Parameters of each, beside what is fixed.
        jobs : int, optional
        """
        asked = replace(self, grid={}, zip={}, sample=None, store=self.kept)
        asked.__dict__["factors"] = [[Choice(dict(point), dict(point)) for point in points]]
        resolver = Resolver()
        asked.run(jobs, resolver=resolver)
        return asked.table(resolver)

"""How late a schedule can end: a proved upper bound from sums alone, so that a roofline's error is known unpriced.

``models.bounds`` is never above ``models.schedule``. Here is a number that is never below it, in the manner of Graham's
bound for list scheduling (a makespan is at most the mean load and the longest unit). Until the unit that ends last gets
its place, at any moment

- blocks may not start yet (at most ``interval`` for each unit before it), or every place is taken, and then
- all SMs serve (at most ``sum(sm) / sms`` in all), or the fullest atomic unit lets draws pass (``sum(draws)``), or
- no unit waits for another: each of them is on its way into its SM, served there, or in its own time. Of this all units
  together have ``sum(start + sm + alone)``, and the places go through it side by side. It is nothing where units never
  wait for a place.

Then that unit waits again in the first two ways, which are counted already, and has its own ``start + sm + alone``.
Memory and atomic units beside the SMs can hold instead, and what is in their way is at most half of a unit's own time.
"""

from tilestamp.models.schedule import IN_THE_WAY, Loads, crowd


def latest_end(units: Loads) -> float:
    """Cycles that ``models.schedule`` cannot exceed.

    Parameters
    ----------
    units : Loads
        What the units load the machine with.
    """
    count = len(units.alone)
    if not count:
        return 0.0
    own = units.alone + crowd(units) + units.sm + units.start
    turns = float(own.sum()) / units.places if count > units.places else 0.0
    served = float(units.sm.sum()) / min(units.sms, count) + float(units.draws.sum())
    end = units.begun + (count - 1) * units.interval + served + turns + float(own.max())
    return max(end, units.memory + units.way, units.atomic + units.way) + IN_THE_WAY * float(units.alone.mean())

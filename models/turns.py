"""Turns: kernels that loop over lists, whose warps ask for a scheduler all along their chains.

Warps of other kernels wait most of their time, and who is in whose way is a matter of chance (``models.schedule``). A
loop asks again and again. So a unit that would take ``chain`` cycles by itself and wants ``own`` of its schedulers
takes neither the larger of the two nor their sum, but ``(chain^KNEE + own^KNEE)^(1/KNEE)``, and so do residents
together, for as long as there are others beside it. Half of that is waited for, as of all that two want at the same
time. And an SM that loads or stores all along gets its share of L2 and DRAM, and no more.
"""

from typing import Any

import numpy as np

from tilestamp.models.kernel import kernel
from tilestamp.models.partition import partitioned

KNEE = 2.5  # H200, experiments/silicon/measured/splat/blending.csv: equal blocks of a loop, 2 to 16 warps a scheduler


@kernel(inline=True)
def both(chain: float, own: float) -> float:
    """Cycles of a loop that wants ``own`` of its schedulers and waits ``chain`` for itself."""
    most = max(chain, own)
    return most * ((chain / most) ** KNEE + (own / most) ** KNEE) ** (1.0 / KNEE) if most > 0.0 else 0.0


@kernel
def at_least(costs: Any, share: Any) -> Any:
    """Costs of the units on their SM, (units,), where it gets no more than its ``share`` of the chip's memory."""
    return np.maximum(costs, share)


@kernel
def rest_of(sm: Any, places: int, sms: int) -> Any:
    """Work of an SM beside and behind each unit, (units,), in cycles.

    Of what is beside it, but for the first round, half is over when it starts. The longest units, one an SM, count as
    no longer than the others: they have an SM to themselves.
    """
    count = len(sm)
    longest = partitioned(sm, count - sms - 1)[count - sms - 1] if count > sms else 0.0
    behind, found = 0.0, np.empty(count)
    for i in range(count - 1, -1, -1):
        found[i] = behind
        behind += min(sm[i], longest)
    beside, back = 0.0, places - sms
    for i in range(count):
        found[i] = (found[i] + (beside if i < places else 0.5 * beside)) / sms
        beside += min(sm[i], longest)
        if i >= back:
            beside -= min(sm[i - back], longest)
    return found


@kernel
def in_turn(own: float, alone: float, rest: float, others: float) -> float:
    """Cycles by which others hold up a unit, were each served before it as often as it is needed.

    Parameters
    ----------
    own, alone : float
        ``Loads`` of the unit.
    rest : float
        ``rest_of``.
    others : float
        Of an SM, what the units beside it would keep busy if nobody waited.
    """
    if others <= 0.0:
        return 0.0
    chain = alone * max(0.0, 1.0 - (own / alone) ** KNEE) ** (1.0 / KNEE)
    crowded: float = both(chain, own + others * alone)
    return max(0.0, crowded - alone) * min(1.0, rest / (others * alone))

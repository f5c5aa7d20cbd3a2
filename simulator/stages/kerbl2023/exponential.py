"""The GPU's own exp, bit for bit: its special function unit raises 2 to a power by a table and a truncated square.

Compiled expf takes the power of 2 apart: a whole number, by a sum that is rounded down, and a rest r from 0 to 1, of
which the unit gives 2**r. The unit looks at 23 bits behind the point: the first 6 choose a row of three tables (of 27,
16 and 10 bits), the other 17 are x in c0 + c1 x + c2 x**2 (Oberman & Siu 2005). Of the square it adds up only products
of bits from column 19 on, and so loses some.

The tables were solved for from all 2**23 outputs of an H200, and each of these is met; so is expf of an H200 at all of
the 188,000,000 floats from -6 to -1e-6, and its decisions and pictures are the same to the bit.
"""

import numpy as np

from tilestamp.simulator.stages.laine2011.exact import fma

BITS = 23  # behind the point that the unit looks at
X_BITS, LOW_BITS = 17, 9  # of x, and of the part of it whose square is lost altogether
CONSTANTS = (
    67108871, 67839637, 68578365, 69325131, 70080037, 70843155, 71614585, 72394419, 73182745, 73979651,
    74785233, 75599595, 76422819, 77255009, 78096263, 78946675, 79806347, 80675381, 81553875, 82441941,
    83339673, 84247185, 85164573, 86091955, 87029435, 87977123, 88935131, 89903573, 90882557, 91872203,
    92872629, 93883943, 94906271, 95939735, 96984451, 98040539, 99108131, 100187349, 101278319, 102381165,
    103496023, 104623021, 105762293, 106913967, 108078183, 109255077, 110444787, 111647451, 112863215,
    114092213, 115334595, 116590509, 117860097, 119143509, 120440895, 121752411, 123078209, 124418441,
    125773269, 127142849, 128527345, 129926917, 131341727, 132771945,
)  # fmt: skip
LINEAR = (
    22713, 22960, 23210, 23463, 23718, 23977, 24238, 24502, 24768, 25038, 25311, 25586, 25865, 26147, 26431,
    26719, 27010, 27304, 27602, 27902, 28206, 28513, 28824, 29138, 29455, 29776, 30100, 30428, 30759, 31094,
    31432, 31775, 32121, 32471, 32824, 33182, 33543, 33908, 34277, 34651, 35028, 35409, 35795, 36185, 36579,
    36977, 37380, 37787, 38198, 38614, 39035, 39460, 39889, 40324, 40763, 41207, 41655, 42109, 42568, 43031,
    43500, 43973, 44452, 44936,
)  # fmt: skip
SQUARE = (
    494, 501, 506, 511, 518, 521, 527, 532, 541, 546, 551, 559, 564, 568, 577, 583, 589, 596, 600, 609, 615,
    622, 627, 633, 641, 647, 655, 661, 670, 677, 686, 691, 699, 705, 715, 721, 730, 739, 748, 753, 763, 773,
    779, 787, 796, 806, 813, 822, 833, 842, 849, 858, 870, 877, 887, 896, 909, 917, 925, 938, 946, 959, 969, 980,
)  # fmt: skip
ADDED = 2018  # to every constant, below its last bit (4096): half of what the truncation loses
LEAST = np.float32(-80)  # below, nothing is visible
PER_252, STEPS, LOG2_E, LOG2_E_LOW = np.float32(0.00572498), 252, np.float32(1.44269502), np.float32(1.92596303e-8)
WHOLE_AT_0 = 126  # what the sum that is rounded down gives for exp(0)


def exp32(power: np.float32) -> np.float32:
    """Exp of a float32 that is not positive; below LEAST as of LEAST."""
    power = max(power, LEAST)
    share = fma(power, PER_252, np.float32(0.5))
    whole = int(np.floor(float(share) * STEPS))
    rest = fma(power, LOG2_E_LOW, fma(power, LOG2_E, np.float32(WHOLE_AT_0 - whole)))
    return power_of_2(rest, whole)


def power_of_2(rest: np.float32, whole: int) -> np.float32:
    """2**(rest + whole - 126), as the unit and the scaling behind it give it."""
    fixed = int(abs(float(rest)) * 2.0**BITS)
    if rest < 0 and fixed:
        fixed = -fixed - 1  # bits are turned around, and no 1 is added
    row, x = fixed >> X_BITS & 63, fixed & (1 << X_BITS) - 1
    total = CONSTANTS[row] * 4096 + ADDED + LINEAR[row] * x + SQUARE[row] * truncated_square(x)
    bits = (total >> 15) + (((fixed >> BITS) + whole) << BITS)
    return np.uint32(bits).view(np.float32)


def truncated_square(x: int) -> int:
    """Products of two bits of 17 added up, those of equal pairs once: only columns from 19 on."""
    high, low = x >> LOW_BITS, x & (1 << LOW_BITS) - 1
    mixed = sum((high >> k & 1) * (low >> LOW_BITS - k) for k in range(1, X_BITS - LOW_BITS))
    return (high * high - (high & 1)) // 2 + mixed

"""Sample tests, which every rasterizer makes: point-in-polygon evaluations, and how many of them hit."""

from tilestamp.models.counters import count, ratio

SAMPLE_COUNTERS = (
    count("SAMPLE_TESTS", "point-in-polygon evaluations by a lane, idle lanes that come along included"),
    count("SAMPLE_HITS", "evaluations that found the sample inside"),
    ratio("ste", "SAMPLE_HITS", "SAMPLE_TESTS", "sample test efficiency: hits by tests"),
)

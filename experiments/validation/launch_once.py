"""Launch every kernel of ``gpu_cases`` once, for a profiler to watch (``python -m`` this module)."""

from tilestamp.experiments.validation.gpu import cupy
from tilestamp.experiments.validation.gpu_cases import gpu_cases
from tilestamp.models.machine import load_machine


def main() -> None:
    """Reset and launch, in order."""
    for case in gpu_cases(load_machine("h200").simt, lambda _: None):
        if case.reset is not None:
            case.reset()
        case.start()
        cupy().cuda.Device().synchronize()


if __name__ == "__main__":
    main()

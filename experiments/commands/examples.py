"""Examples that ``--help`` shows below each command: what is typed, and what for."""

EXAMPLES: dict[str, tuple[tuple[str, str], ...]] = {
    "": (
        ("render teapot", "how long a frame takes, stage by stage"),
        ("reproduce", "published tables beside what the model computes"),
        ("list machines", "what there is: also scenes, pipelines, experiments"),
        ("--install-completion", "complete names and options in this shell, once and for all"),
    ),
    "render": (
        ("render teapot -o teapot.png", "a picture, and the time of each stage"),
        ("render model.obj", "a model of yours, by a pipeline and a machine that can draw it"),
        ("render teapot --machine h200 --why", "what holds each stage, and what would help"),
        ("render teapot --tile 16 --set sm.count=60", "another tile, another machine"),
        ("render teapot -o teapot.png --map tests", "and a heat map of the tests in each tile"),
        ("render teapot --columns all", "all that is counted"),
    ),
    "compare": (
        ("compare teapot --machine gtx280 --machine h200", "two machines"),
        ("compare teapot -O tile=8 -O tile=16 -o tiles.png", "two tiles, and a plot"),
    ),
    "study": (
        ("study tiles.toml --dry-run", "how many cells, executions and seconds"),
        ("study tiles.toml -o tiles.csv", "run what is missing, and write the table"),
    ),
    "ask": (
        ("ask best tiles.toml tile --over zoom,machine -o map.png", "which tile where"),
        ("ask front tiles.toml milliseconds area", "what nothing beats in both"),
        ("ask screen tiles.toml", "which axes matter"),
    ),
    "reproduce": (
        ("reproduce", "the quick experiments"),
        ("reproduce eisenacher2010/table3", "one table, in full"),
        ("reproduce --all -j 4", "all of them, in four processes"),
    ),
    "page": (("page", "the page of the results that lie in reports/results"),),
    "validate": (
        ("validate --machine my-gpu.toml", "the model beside the GPU of this computer"),
        ("validate --measurements FOLDER -o cells.csv", "the same from stored measurements"),
    ),
    "measure-machine": (("measure-machine -o my-gpu.toml", "a machine file of the GPU of this computer"),),
    "list": (
        ("list experiments", "all that can be reproduced"),
        ("list options micropolygon --machine gtx280", "what each option takes, and what this machine can launch"),
        ("list maps tiled", "heat maps that render --map draws"),
        ("list numbers h200", "each number of a machine, its provenance and source"),
        ("list views teapot", "cameras of a scene by name"),
    ),
}


def epilogue(command: str) -> str:
    """Examples of a command as Markdown."""
    lines = [f"`tilestamp {typed}`: {what}" for typed, what in EXAMPLES[command]]
    return "  \n".join(["**Examples**", *lines])  # two blanks: a line each

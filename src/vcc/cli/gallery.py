"""``vcc gallery``: published cameras, listed or rebuilt."""

from pathlib import Path

from vcc.cli.console import make_folder, progress, show
from vcc.cli.options import OutputFolder, ShownLightField
from vcc.gallery import entries, entry, write_entry


def gallery(
    name: str | None = None,
    /,
    *,
    light_field: ShownLightField | None = None,
    output: OutputFolder | None = None,
) -> None:
    """Rebuild a published camera, from optics to decoded result, and compare it with its claims.

    Examples:
        vcc gallery
        vcc gallery wavefront-coding
        vcc gallery biprism-stereo --light-field views/ -o stereo

    Args:
        name: Name of a camera. Without it, all are listed.
        light_field: Your own light field: a folder of views, a file or a store. Default: the built-in scene.
        output: Folder for the page and its pictures. Default: vcc-gallery/NAME.
    """
    if name is None:
        for each in entries():
            show(f"{each.name}\n    {each.title}. {each.citation}")
        return
    chosen = entry(name)
    folder = make_folder(Path("vcc-gallery") / name if output is None else output)
    with progress(chosen.title) as advance:
        result = chosen.run(light_field, advance)
    for number in result.numbers:
        claim = f" (claim: {number.claim}; {number.verdict})" if number.claim else ""
        show(f"{number.what}: {number.measured}{claim}")
    show(f"{write_entry(chosen, result, folder)}: written")

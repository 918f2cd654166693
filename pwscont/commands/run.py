"""The work of ``pwscont run``: solve a scene, print the answer, write files, keep a journal."""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from pwscont import GraphFileError, InvalidInputError, Journal, PwscontError
from pwscont.commands.options import look_of, with_panels
from pwscont.commands.origin import Origin, write_origin
from pwscont.commands.progress import Progress
from pwscont.commands.view import check_viewable, write_page
from pwscont.extending import counted
from pwscont.scenes.answer import DEFAULT_LOOK, Answer, Look, Runnable
from pwscont.scenes.registry import load_scene


def run_scene(options: argparse.Namespace) -> int:
    """Run a scene with the options of the command line, and return the exit status."""
    scene = load_scene(options.scene, dict(options.settings))
    with _failing_in_words(scene, options.settings):
        return _run(scene, options)


@contextmanager
def _failing_in_words(scene: Runnable, settings: Sequence[tuple[str, str]]) -> Iterator[None]:
    """Turn an error of numerics into the message that a scene cannot be computed."""
    try:
        yield
    except PwscontError:
        raise
    except (ArithmeticError, ValueError) as error:  # the error of linear algebra is a ValueError
        given = " ".join(f"{name}={value}" for name, value in settings)
        why = f"{type(error).__name__}: {' '.join(str(error).split())}"
        hint = f"; check the settings {given}" if given else ""
        raise InvalidInputError(f"scene {scene.name} cannot be computed: {why}{hint}") from error


def _run(scene: Runnable, options: argparse.Namespace) -> int:
    at, look = scene.values(options.at), look_of(options, scene)
    scene = with_panels(options, scene)
    if options.html:
        check_viewable(scene, options.html)
    if options.output:
        make_directory(options.output)
    with _journalled(scene, options.output, options.resume) as kept:
        begin = time.perf_counter()
        answer = _solved(kept, at)
        answer = answer.in_full() if options.full else answer
        seconds = time.perf_counter() - begin
        plan = scene.plan() if options.explain else {}
        text = _as_json(answer, plan, seconds) if options.json else _as_text(answer, plan)
        unprinted = _print(text)
        if options.output:
            origin = Origin(options.scene, dict(options.settings))
            _say_written(write_whole(answer, options.output, look, origin))
        if options.html:
            _say_written([write_page(answer, options.html)])
    if unprinted:
        raise unprinted
    return 0


def _say_written(files: Sequence[Path]) -> None:
    print(f"written: {', '.join(map(str, files))}", file=sys.stderr)  # noqa: T201


def _print(text: str) -> OSError | None:
    """Print the answer, and return an error instead of raising: files may still be written."""
    try:
        print(text, flush=True)  # noqa: T201
    except OSError as error:
        return error
    return None


def write_whole(
    answer: Answer, directory: Path, look: Look = DEFAULT_LOOK, origin: Origin | None = None
) -> list[Path]:
    """Write the files of an answer into a directory, all or none, and return the files.

    The file of a graph names the scene of the graph.
    """
    try:
        with TemporaryDirectory(dir=directory, prefix=".unfinished-") as temporary:
            written = [file.relative_to(temporary) for file in answer.write(Path(temporary), look)]
            if origin and answer.explored():
                _sign(Path(temporary), origin)
            for name in os.listdir(temporary):
                os.replace(Path(temporary, name), directory / name)
    except (OSError, GraphFileError) as error:
        cause = error if isinstance(error, OSError) else error.__cause__
        reason = getattr(cause, "strerror", None) or error
        where = getattr(cause, "filename2", None) or f"to {directory}"
        raise InvalidInputError(f"cannot write {where}: {reason}") from error
    return [directory / file for file in written]


def _sign(directory: Path, origin: Origin) -> None:
    """Write the origin, scene and settings, into the graph files of a directory."""
    for file in directory.glob("*.npz"):
        write_origin(file, origin)


def _solved(scene: Runnable, at: Sequence[float]) -> Answer:
    progress = Progress(scene.parameter)
    try:
        return scene.solve(at, progress)
    finally:
        progress.close()


@contextmanager
def _journalled(scene: Runnable, output: Path | None, resume: bool) -> Iterator[Runnable]:
    """Yield the scene with a journal if files are written, then delete the journal."""
    path = output / f"{scene.name}.journal" if output and scene.resumable else None
    _check_unfinished(scene, path, resume)
    if path is None:
        yield scene
        return
    journal = Journal(path)
    try:
        yield scene.with_journal(journal)
    except KeyboardInterrupt:
        if not len(journal):
            journal.remove()
            raise
        kept = f"{_kept(len(journal))} kept in {path}; --resume goes on from there"
        print(f"pwscont: {kept}", file=sys.stderr)  # noqa: T201
        journal.close()
        raise
    except BaseException:
        if journal.trouble:  # the journal lacks later pieces
            journal.remove()
        journal.close()
        raise
    journal.remove()


def _kept(count: int) -> str:
    return f"{counted(count, 'piece')} {'is' if count == 1 else 'are'}"


def _check_unfinished(scene: Runnable, path: Path | None, resume: bool) -> None:
    if path is None:
        if resume and not scene.resumable:
            raise InvalidInputError(f"the scene {scene.name} keeps no journal to resume from")
        if resume:
            raise InvalidInputError("--resume needs -o DIR, the directory of the interrupted run")
    elif path.exists() and not resume:
        _make_way(path)


def _make_way(path: Path) -> None:
    """Remove the journal of a finished run, or a journal without pieces, else refuse."""
    journal = Journal(path)  # refuses a journal that another process is writing
    if not journal.is_finished and len(journal):
        journal.close()
        raise InvalidInputError(
            f"{path} holds an unfinished run: --resume goes on with it; remove it to begin again"
        )
    journal.remove()


def make_directory(directory: Path) -> None:
    """Create the output directory, before any work."""
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = error.strerror or error
        raise InvalidInputError(f"cannot make the directory {directory}: {reason}") from error


def _as_text(answer: Answer, plan: Mapping[str, str]) -> str:
    lines = [f"  {part}: {words}" for part, words in plan.items()]
    return "\n".join([answer.as_text(), *(["", "What was done"] if lines else []), *lines])


def _as_json(answer: Answer, plan: Mapping[str, str], seconds: float) -> str:
    told = {"plan": dict(plan)} if plan else {}
    return json.dumps(answer.as_dict() | {"seconds": seconds} | told, ensure_ascii=False)

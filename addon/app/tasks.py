"""Long work beside a window: a use-case yields what needs no Blender as tasks, and gets each one's result back.

What touches Blender stands between the tasks and runs on the main thread; a task may run on another one, so that the
window stays alive and can stop it.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from threading import Event
from typing import Any

Progress = Callable[[int, int], bool]
"""Called with what is done and what there is to do; False stops the work, which then raises Cancelled."""


@dataclass(frozen=True)
class Task:
    """label: what is done, for people. run: called with a Progress, from any thread."""

    label: str
    run: Callable[[Progress], Any]


Tasks = Generator[Task, Any, Any]


def run_tasks(tasks: Tasks, progress: Progress | None = None) -> Any:
    """All of it at once, on this thread. Returns what the generator returns; raises what it or a task raises."""
    result = None
    try:
        while True:
            result = tasks.send(result).run(progress or (lambda done, total: True))
    except StopIteration as end:
        return end.value
    finally:
        tasks.close()


class TaskRunner:
    """The same in small steps: `step` on the main thread, as often as one likes, until `done`.

    label, share: what runs now, and how much of it is done, 0 to 1. result: what the generator returned.
    """

    def __init__(self, tasks: Tasks):
        self.label, self.share, self.done, self.result = "", 0.0, False, None
        self._tasks, self._stop = tasks, Event()
        self._worker = ThreadPoolExecutor(1, thread_name_prefix="sanguine")
        self._running: Future[Any] | None = None

    def step(self) -> None:
        """Goes on if the running task is through. Raises what it raised; then, as after the end, nothing runs any more."""
        if self.done or self._running is not None and not self._running.done():
            return
        try:
            task = self._tasks.send(self._running.result() if self._running else None)
            self.label, self.share = task.label, 0.0
            self._running = self._worker.submit(task.run, self._progress)
        except StopIteration as end:
            self.result = end.value
            self._close()
        except BaseException:
            self._close()
            raise

    def stop(self) -> None:
        """Ends the running task and the work. Returns when nothing runs any more."""
        self._stop.set()
        self._close()

    def _progress(self, done: int, total: int) -> bool:
        self.share = done / total if total else 1.0
        return not self._stop.is_set()

    def _close(self) -> None:
        self.done = True
        self._worker.shutdown(wait=True, cancel_futures=True)
        self._tasks.close()

"""Several runs that share an operator: one product answers the requests of all of them.

Each run is a thread, and they take turns: one works until it needs the operator. When all wait for it, it is
applied to all their arrays. So a method is written for one raw image, and knows nothing of others.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from threading import Condition
from typing import ClassVar, TypeVar

from lumigraph.core.arrays import Array
from lumigraph.core.linear import Linear, Shape

Found = TypeVar("Found")


@dataclass(slots=True)
class _Question:
    """An array that a run wants mapped, and its image."""

    back: bool
    array: Array
    answer: Array | None = None
    error: BaseException | None = None


@dataclass(slots=True)
class _Table:
    """Runs that have not ended, the requests of some of them, and the error that ends them all."""

    runs: int
    asked: list[_Question] = field(default_factory=list)
    stop: BaseException | None = None


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Meeting(Linear):
    """An operator that waits until all runs need it.

    Parameters
    ----------
    of
        The operator.
    """

    of: Linear
    _table: _Table
    _turn: Condition = field(default_factory=Condition)

    title: ClassVar[str] = "A map that several runs share"

    @property
    def shape(self) -> tuple[Shape, Shape]:
        """Shape of the operator."""
        return self.of.shape

    def attended(self, run: Callable[[Linear], Found]) -> Found:
        """Result of a run that applies this."""
        with self._turn:
            try:
                return run(self)
            finally:
                self._table.runs -= 1
                self._answer()

    def dismiss(self, error: BaseException) -> None:
        """End all runs by an error, at the latest at their next request."""
        with self._turn:
            self._table.stop = error
            self._turn.notify_all()

    def _forward(self, intensity: Array) -> Array:
        return self._asked(_Question(False, intensity))

    def _adjoint(self, raw: Array) -> Array:
        return self._asked(_Question(True, raw))

    def _asked(self, question: _Question) -> Array:
        self._table.asked.append(question)
        self._answer()
        while question.answer is None and question.error is None and self._table.stop is None:
            self._turn.wait()
        if (error := self._table.stop or question.error) is not None:
            raise error
        return question.answer

    def _answer(self) -> None:
        """Apply the operator, once all runs that have not ended need it."""
        questions = tuple(self._table.asked)
        if not questions or len(questions) < self._table.runs or self._table.stop is not None:
            return
        self._table.asked.clear()
        for back, mapped in ((False, self.of._forwards), (True, self.of._adjoints)):
            mine = [question for question in questions if question.back is back]
            try:
                answers = mapped([question.array for question in mine]) if mine else []
                for question, answer in zip(mine, answers, strict=True):
                    question.answer = answer
            except Exception as error:  # each run ends by it
                for question in mine:
                    question.error = error
        self._turn.notify_all()


def side_by_side(operator: Linear, runs: Sequence[Callable[[Linear], Found]]) -> list[Found | Exception]:
    """Result of each run that is called with an operator, or the error that ended it.

    At most ``operator.side_by_side`` of them.
    """
    meeting = Meeting(operator, _Table(len(runs)))
    with ThreadPoolExecutor(len(runs), thread_name_prefix="lumigraph-run") as pool:
        futures = [pool.submit(meeting.attended, run) for run in runs]
        try:
            return [_outcome(future.exception(), future.result) for future in futures]
        except BaseException as stopped:  # Ctrl-C reaches the first thread, while others still work
            meeting.dismiss(stopped)
            raise


def _outcome(error: BaseException | None, result: Callable[[], Found]) -> Found | Exception:
    if error is None:
        return result()
    if not isinstance(error, Exception):
        raise error
    return error

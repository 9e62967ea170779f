"""Rules as a table: tried in order, the first one whose condition holds gives the verdict and the sentence that says
why."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

FindingsT = TypeVar("FindingsT")
Candidates = tuple[str, ...]


@dataclass(frozen=True)
class Rule(Generic[FindingsT]):
    """One row of a table.

    name : identifies the row in diagnosis.json. condition : when it decides. verdict : "none", "ambiguous", "unknown"
    or an effect's id. sentence : why, for the reader. candidates : ids of the effects named. reason : a sentence that
    depends on the findings, in place of `sentence`; None for none.
    """

    name: str
    condition: Callable[[FindingsT], bool]
    verdict: str | Callable[[FindingsT], str]
    sentence: str
    candidates: Callable[[FindingsT], Candidates] = lambda _: ()
    reason: Callable[[FindingsT], str] | None = None


@dataclass(frozen=True)
class Decision:
    """What a table decides. rule : name of the row that did. verdict, candidates, sentence : see `Rule`."""

    rule: str
    verdict: str
    candidates: Candidates
    sentence: str


def first_that_holds(rules: Sequence[Rule[FindingsT]], findings: FindingsT) -> Decision:
    """The first row whose condition holds; the last one must hold always. Raises StopIteration where none does."""
    rule = next(r for r in rules if r.condition(findings))
    verdict = rule.verdict if isinstance(rule.verdict, str) else rule.verdict(findings)
    sentence = rule.sentence if rule.reason is None else rule.reason(findings)
    return Decision(rule.name, verdict, rule.candidates(findings), sentence)


def always(_: object) -> bool:
    """Condition of a last row."""
    return True

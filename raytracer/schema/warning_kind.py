"""Kinds of warnings: what each says, when, and what to do about it.

A family of them is a package called `warnings`, beside what it warns of, and one kind is one module of it, found by
looking.  A kind's module defines one subclass of `WarningKind`.  docs/warnings.md is generated from all of them.
"""

import importlib
import pkgutil
from abc import ABC, abstractmethod
from collections.abc import Iterator
from functools import cached_property
from typing import ClassVar, Generic, NamedTuple, TypeAlias, TypeVar

from raytracer.schema.yaml_nodes import KeyPath

Subject = TypeVar("Subject")


class Sentence(NamedTuple):
    """Sentence that a kind of warnings says.

    text : a template of `str.format`, in which `{remedy}` stands for the remedy.
    when : the case in which it is said, for the manual.
    remedy : what to do about it, a template too.
    advice : what the manual adds to the remedy.
    """

    text: str
    when: str
    remedy: str
    advice: str = ""

    def fill(self, **values: object) -> str:
        """Write the sentence with these values in it."""
        return self.text.format(remedy=self.remedy.format(**values), **values)


class WarningRecord(NamedTuple):
    """A warning.

    kind : the name of its kind.
    keys : path of what it is about, in the scene or within what it was found in.
    text : one sentence.
    """

    kind: str
    keys: KeyPath
    text: str


Warned: TypeAlias = Iterator[WarningRecord]
"""Records that a kind finds."""


class WarningKind(ABC, Generic[Subject]):
    """Base of the kinds of warnings; their sentences are attributes of the class.

    name : what several of them are called, as in "and 3 more surfaces that coincide"; kinds may share one.
    section : of the manual.
    rank : place among the kinds of its family, the lowest first.
    """

    name: ClassVar[str]
    section: ClassVar[str]
    rank: ClassVar[int]

    @abstractmethod
    def find(self, subject: Subject) -> Warned:
        """Find the warnings of this kind."""

    def record(self, text: str, *keys: str | int) -> WarningRecord:
        """Make a warning of this kind."""
        return WarningRecord(self.name, keys, text)

    @classmethod
    def sentences(cls) -> list[Sentence]:
        """List what warnings of this kind may say."""
        return [value for value in vars(cls).values() if isinstance(value, Sentence)]


class WarningFamily(Generic[Subject]):
    """The kinds of warnings about one sort of things, one a module of a package."""

    def __init__(self, package: str) -> None:
        self.package = package

    @cached_property
    def kinds(self) -> tuple[WarningKind[Subject], ...]:
        """All kinds, by rank; imports every module of the package."""
        found: list[WarningKind[Subject]] = []
        for info in pkgutil.iter_modules(importlib.import_module(self.package).__path__):
            if not info.ispkg:
                module = importlib.import_module(f"{self.package}.{info.name}")
                found += (value() for value in vars(module).values() if _is_kind(value, module.__name__))
        return tuple(sorted(found, key=lambda kind: kind.rank))

    def find(self, subject: Subject) -> list[WarningRecord]:
        """Find the warnings of all kinds."""
        return [record for kind in self.kinds for record in kind.find(subject)]


def _is_kind(value: object, module: str) -> bool:
    return isinstance(value, type) and issubclass(value, WarningKind) and value.__module__ == module

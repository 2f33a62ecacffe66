"""The component that rt_launcher loads, from its arguments or its private parameters."""

import getopt
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from rtcf_launch.codes import Code, Ending
from rtcf_launch.parameters import Parameters

_NAMES = ("rt_package", "rt_type")
# As in RTCF 2021, which accepts abbreviations, too.
_FIRST = ("-f", "--is_first")
_NAME = ("-c", "--component_info")


@dataclass(frozen=True)
class ComponentChoice:
    """A package, a component type, and whether the component is first; empty = not given."""

    package: str = ""
    type: str = ""
    first: bool = False

    @classmethod
    def parse(cls, words: Sequence[str]) -> "ComponentChoice":
        """Take `[-f|--is_first] [PACKAGE COMPONENT]` in any order, or each name as the value of an
        option -c or --component_info.  Raises Ending."""
        names: list[str] = []
        first = False
        rest = [each.strip() for each in words]
        while rest:
            try:
                options, rest = getopt.getopt(
                    rest, "fc:", [_FIRST[1].lstrip("-"), f"{_NAME[1].lstrip('-')}="]
                )
            except getopt.GetoptError as error:
                known = ", ".join((*_FIRST, *_NAME))
                raise Ending(Code.USAGE, f"{error}: use {known}") from None
            first = first or any(option in _FIRST for option, _ in options)
            names += [value for option, value in options if option in _NAME]
            names += rest[:1]
            del rest[:1]
        if len(names) not in (0, 2):
            raise Ending(
                Code.USAGE,
                f'name a package and a component, as in args="rtcf_examples Mimo", '
                f"not {len(names)} word{'s' if len(names) > 1 else ''}",
            )
        package, type_name = names or ("", "")
        return cls(package, type_name, first)

    def with_parameters(self, values: dict[str, Any]) -> "ComponentChoice":
        """Return the choice of these arguments and of ~rt_package, ~rt_type and ~is_first.

        Removes ~rt_package and ~rt_type from `values`.  Raises Ending if the component is named
        twice or not at all.
        """
        package, type_name = self.package, self.type
        given = Parameters(values)
        named = [name for name in _NAMES if given.has(name)]
        if package and named:
            raise Ending(
                Code.USAGE, f"~{named[0]} and the arguments both name the component: use one"
            )
        if self.first and given.has("is_first"):
            raise Ending(Code.USAGE, "~is_first and -f both make the component first: use one")
        if not package:
            package, type_name = ((given.text(name) or "").strip() for name in _NAMES)
        if not package or not type_name:
            raise Ending(
                Code.USAGE,
                'name a package and a component, as in args="rtcf_examples Mimo", or by '
                "~rt_package and ~rt_type",
            )
        for name in named:
            del values[name]
        # RTCF 2021 named namespaces, too; classes are registered by their last name.
        return ComponentChoice(package, type_name.rpartition("::")[2], self.first)

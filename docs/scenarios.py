"""A page for every scenario preset, made of the docstring of its file and of the scenario itself."""

from __future__ import annotations

import inspect
from importlib import import_module
from pathlib import Path

from wsn_env import Scenario
from wsn_env.scenario import named_scenarios

MAKE = 'gymnasium.make("wsn_env/{name}")'
MAKE_VEC = 'gymnasium.make_vec("wsn_env/{name}", num_envs=64, vectorization_mode="vector_entry_point")'
PAGE = """# {name}

![A period of {name}](../scenario_{name}.png)

{text}

| | |
|---|---|
| make | `{make}`, native batch: `{make_vec}` |
| nodes report | {measurement} |
| action | `Discrete(28)`; others by `action=` ([all](../../reference.md#actions)) |
| observation | `"candidates"`, a flat `Box`; others by `observation=` ([all](../../reference.md#observations)) |
| reward | minus (error [m] + lam x energy [mJ]) of the time step ([more](../../environment.md#reward)) |
| start | {start} |
| end | truncated after {periods} time steps; never terminated |

## Arguments

Any of these by keyword, with an action, an observation, a reward, an order of merit, `candidates` and `render_mode`
([frames](../../seeing.md#frames)).

```{{eval-rst}}
.. quantities:: {name}
```
"""


def write_pages(folder: Path) -> None:
    """A file NAME.md for each."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, scenario in named_scenarios().items():
        (folder / f"{name}.md").write_text(_page(name, scenario), encoding="utf-8")


def _page(name: str, scenario: Scenario) -> str:
    module = import_module(f"wsn_env.scenario.presets.{name.replace('-', '_')}")
    t = scenario.tracking
    start = f"the target is known up to sd {t.start_sd_m:g} m and {t.start_sd_ms:g} m/s"
    own = inspect.getdoc(type(scenario.measurement)) or ""
    return PAGE.format(
        name=name,
        text=inspect.getdoc(module),
        make=MAKE.format(name=name),
        make_vec=MAKE_VEC.format(name=name),
        measurement=own.partition("\n\n")[0].replace("\n", " "),
        start=start if t.start == "known" else "the target is anywhere",
        periods=scenario.periods,
    )

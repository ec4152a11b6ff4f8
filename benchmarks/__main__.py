"""Run every benchmark of this folder and print its table."""

import importlib
import pkgutil

import benchmarks


def main() -> None:
    for module in sorted(found.name for found in pkgutil.iter_modules(benchmarks.__path__)):
        if module.startswith("_"):
            continue
        benchmark = importlib.import_module(f"benchmarks.{module}")
        print(f"\n{module}: {(benchmark.__doc__ or '').splitlines()[0]}")
        benchmark.show(benchmark.run())


if __name__ == "__main__":
    main()

"""How kernels, entries and host functions are compiled, and what may call what."""

from __future__ import annotations

import gc
from typing import NamedTuple

import numba
import numpy as np
import pytest
from numba.core.caching import NullCache
from numba.core.compiler import CompilerBase

from lumipath.lang import DEBUG_PYTHON, called_not_inlined, compiled, entry, f32, i32, kernel, load, start_of, store
from lumipath.lang.compiler import EntryCompiler, EntryLibrary, KernelLibrary
from lumipath.lang.whole import WholeTuple, whole_type

pytestmark = pytest.mark.skipif(DEBUG_PYTHON, reason="nothing is compiled")


@kernel
def doubled(x):
    return x + x


@kernel
def folded(values, n):
    total = f32(0.0)
    for i in range(n):
        total = doubled(total) + min(load(values, i), 100.0)
    return total


def folding(values, out):
    store(out, 0, folded(values, len(values)))


def result_of(function):
    out = np.zeros(1, np.float32)
    function(np.array([1, 2, 3, 200], np.float32), out)
    return out[0]


def test_a_kernel_is_llvm_code_only_and_its_entry_is_one_function_of_machine_code():
    fold = entry(folding)
    fold._cache = NullCache()
    assert result_of(fold) == 122
    for function in (doubled, folded):
        for made in function.overloads.values():
            assert isinstance(made.library, KernelLibrary)
            assert made.library.get_pointer_to_function(made.fndesc.llvm_func_name) == 0
    (made,) = fold.overloads.values()
    assert isinstance(made.library, EntryLibrary)
    # The function and its wrapper for Python: all kernels are inlined, and no copy of them is left.
    defined = [function.name for function in made.library.get_defined_functions()]
    assert len(defined) == 2
    assert not any("doubled" in name or "folded" in name for name in defined)


@kernel
def last_of(values, n):
    called_not_inlined()
    return load(values, n - 1)


def last_and_first(values, out):
    # As an address, of which LLVM code has no more than that.
    store(out, 0, last_of(start_of(values), i32(len(values))) + last_of(start_of(values), i32(1)))


def test_a_kernel_that_is_called_has_one_copy_of_its_code():
    both = entry(last_and_first)
    both._cache = NullCache()
    assert result_of(both) == 201
    (made,) = both.overloads.values()
    assert sum("last_of" in function.name for function in made.library.get_defined_functions()) == 1


class Scales(NamedTuple):
    factors: np.ndarray
    offset: np.float32


class Numbers(NamedTuple):
    values: np.ndarray
    scales: Scales
    count: np.int32


@kernel
def scaled(scales, x):
    return x * load(scales.factors, 0) + scales.offset


@kernel
def scaled_sum(numbers):
    total = f32(0.0)
    for i in range(numbers.count):
        total += scaled(numbers.scales, load(numbers.values, i))
    return total


def summing(numbers, out):
    """Write the sum."""
    store(out, 0, scaled_sum(numbers))


def numbers_of(kind):
    return Numbers(np.array([1, 2, 4], kind), Scales(np.array([10], np.float32), f32(0.5)), i32(3))


def test_tuples_of_arrays_are_passed_whole():
    function = entry(summing)
    function._cache = NullCache()
    out = np.zeros(1, np.float32)
    for kind in (np.float32, np.int32):
        function(numbers_of(kind), out)
        assert out[0] == 71.5
    assert (function.__name__, function.__doc__) == ("summing", "Write the sum.")
    wholes = set()
    for inner in (scaled_sum, scaled):
        for (first, *_), made in inner.overloads.items():
            assert type(first) is WholeTuple
            wholes.add(first)
            defined = made.library.generated().get_function(made.fndesc.llvm_func_name)
            # Where the result goes, where an exception would go, and one value for each argument.
            assert len(list(defined.arguments)) == 2 + len(made.signature.args)
    # One for each type of values, and one of the scales, which the two share.
    assert len(wholes) == 3
    assert all(len(kind.name) < 40 for kind in wholes)


def test_tuples_of_other_fields_are_other_types():
    floats, integers = (numba.typeof(numbers_of(kind)) for kind in (np.float32, np.int32))
    assert whole_type(floats) == whole_type(numba.typeof(numbers_of(np.float32)))
    assert hash(whole_type(floats)) == hash(whole_type(numba.typeof(numbers_of(np.float32))))
    assert whole_type(floats) != whole_type(integers)
    assert whole_type(floats) != floats
    assert whole_type(numba.typeof(f32(1))) == numba.float32


def test_a_function_of_numba_itself_may_call_kernels():
    assert result_of(numba.njit(folding)) == 122


@compiled
def counted(values, limit):
    many = 0
    for i in range(len(values)):
        many += values[i] < limit
    return many


@compiled
def below_and_above(values, limit):
    found = np.empty(2, np.int64)
    found[0] = counted(values, limit)
    found[1] = len(values) - found[0]
    return found


def test_host_functions_are_called_by_python_and_by_each_other():
    values = np.arange(10.0)
    assert counted(values, 3.0) == 3
    np.testing.assert_array_equal(below_and_above(values, 4.0), [4, 6])
    # What takes another in, has it inside: Python called that one once only.
    assert len(counted.dispatcher.overloads) == 1
    (made,) = below_and_above.dispatcher.overloads.values()
    assert not any("counted" in part.name for part in made.library._linking_libraries)


def test_an_error_in_a_host_function_that_another_calls_says_what_is_wrong():
    @compiled
    def broken(x):
        return x.there_is_no_such_field

    @compiled
    def caller(x):
        return broken(x)

    with pytest.raises(numba.TypingError, match="there_is_no_such_field"):
        caller(1.0)


@pytest.mark.parametrize("before", [(700, 10, 10), (0, 10, 10), (1_000_000, 5, 5)])
def test_a_compiler_looks_for_garbage_rarely_and_leaves_no_trace_of_that(monkeypatch, before):
    seen = []

    def fail(compiler, function):
        seen.append(gc.get_threshold())
        raise numba.TypingError("no")

    monkeypatch.setattr(CompilerBase, "compile_extra", fail)
    ours = gc.get_threshold()
    gc.set_threshold(*before)
    try:
        with pytest.raises(numba.TypingError):
            object.__new__(EntryCompiler).compile_extra(None)
        assert gc.get_threshold() == before
    finally:
        gc.set_threshold(*ours)
    # 0: it was switched off.
    assert seen == [(max(before[0], 100_000) if before[0] else 0, *before[1:])]

"""A kernel has two forms, other kernels call the inner one, and functions of others stay Numba's."""

import pickle

import numba
import numpy as np
import pytest
from numba.core import caching, config
from numba.core.codegen import JITCodeLibrary
from numba.core.errors import NumbaError
from numba.core.registry import CPUDispatcher

from entropy_explore_env.compilation import cache, stamps
from entropy_explore_env.compilation.dispatchers import InnerKernel, Kernel
from entropy_explore_env.compilation.kernels import inlined_kernel, kernel, lean_kernel
from entropy_explore_env.compilation.libraries import InnerLibrary


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path))
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    return tmp_path


@inlined_kernel
def squared(x):
    return x * x


@lean_kernel
def cubed(x):
    return x * squared(x)


@kernel
def refused(x):
    if x > 2:
        raise ValueError("too large")
    return x


@kernel
def root(x):
    out = np.zeros(3)
    out[0] = squared(x)
    out[1] = cubed(2)
    out[2] = refused(x)
    return out


def test_inner_kernels_are_intermediate_code_that_the_outermost_holds():
    assert root(2.0).tolist() == [4.0, 8.0, 2.0]
    for inner in (squared.inner, cubed.inner, refused.inner):
        assert isinstance(inner, InnerKernel)
        for result in inner.overloads.values():
            assert isinstance(result.library, InnerLibrary)
            defined = [function.name for function in result.library.get_defined_functions()]
            assert result.fndesc.llvm_func_name in defined
            assert not any("cpython" in name or "cfunc" in name for name in defined)
    assert isinstance(root, Kernel) and not squared.overloads and not cubed.overloads
    (result,) = root.overloads.values()
    defined = [function.name for function in result.library.get_defined_functions()]
    assert any("cpython" in name for name in defined) and not any("cfunc" in name for name in defined)


def test_python_may_call_what_kernels_call():
    assert root(1.0)[0] == 1.0
    assert squared(3.0) == 9.0 and cubed(3) == 27
    assert list(squared.overloads) == [(numba.float64,)]


def test_a_kernel_that_raises_does_so_in_python():
    with pytest.raises(ValueError, match="too large"):
        root(3.0)
    with pytest.raises(ValueError, match="too large"):
        refused(3)


def test_kernels_that_call_themselves_are_refused():
    @lean_kernel
    def factorial(n):
        if n < 2:
            return 1
        return n * factorial(n - 1)

    @lean_kernel
    def calling(n):
        return factorial(n)

    for refused_kernel in (factorial, calling, factorial):
        with pytest.raises(NumbaError, match="factorial calls itself"):
            refused_kernel(3)


def test_a_kernel_may_be_an_argument_and_is_not_kept_then(folder):
    @lean_kernel
    def applied(function, x):
        return function(x)

    assert applied(squared, 3.0) == 9.0
    assert applied(cubed, 3.0) == 27.0
    assert not any("applied" in file.name for file in folder.rglob("*.kernel"))


def test_inlined_kernels_are_not_kept_others_are(folder):
    @inlined_kernel
    def within(x):
        return x + 1.0

    @lean_kernel
    def called(x):
        return within(x)

    @kernel
    def calling(x):
        return called(x)

    assert calling(1.0) == 2.0
    names = sorted(file.name.rpartition("-")[0].rpartition(".")[2] for file in folder.rglob("*.kernel"))
    assert names == ["called", "calling"]


def test_constants_short_integers_and_fields_of_records_are_compiled_once():
    @lean_kernel
    def plus(array, number, count):
        return array[0] + number + count

    @kernel
    def calling(records, array, number):
        field = records[0].field
        return plus(array, number, 1) + plus(field, np.int16(2), number) + plus(field, number, count=3)

    records = np.array([([4.0, 5.0],)], [("field", float, (2,))])
    assert calling(records, np.array([8.0]), 16) == (8 + 16 + 1) + (4 + 2 + 16) + (4 + 16 + 3)
    assert list(plus.inner.overloads) == [(numba.float64[::1], numba.int64, numba.int64)]


def test_unsigned_numbers_and_truth_values_stay_what_they_are():
    @lean_kernel
    def doubled(number):
        return number + number

    @kernel
    def calling(byte, truth):
        return doubled(byte), doubled(truth)

    assert calling(np.uint8(200), True) == (400, 2)
    assert len(doubled.inner.overloads) == 2


def test_a_kernel_goes_to_another_process_and_back():
    assert pickle.loads(pickle.dumps(root)) is root


def test_functions_of_others_are_compiled_as_ever(folder):
    @numba.njit
    def others(x):
        return squared(x) + 1.0

    @numba.njit(cache=False)
    def plain(x):
        return x

    @kernel
    def calling(x):
        return plain(x)

    assert others(2.0) == 5.0 and calling(2.0) == 2.0
    assert type(others) is CPUDispatcher and isinstance(vars(others)["_cache"], caching.NullCache)
    (result,) = others.overloads.values()
    assert type(result.library) is JITCodeLibrary and result.library.get_asm_str()


def test_symbols_are_named_after_what_they_were_compiled_from():
    """Numba counts functions in each process: two of one name, from two processes, would be one symbol."""

    def made(number):
        @lean_kernel
        def one(x):
            return x + number

        return one

    kernels = [made(1.0), made(2.0), made(1.0)]
    assert [one(1.0) for one in kernels] == [2.0, 3.0, 2.0]
    names = [next(iter(one.overloads.values())).fndesc.mangled_name for one in kernels]
    assert names[0] == names[2] != names[1]


@pytest.mark.parametrize("setting", ["OPT", "BOUNDSCHECK", "LOOP_VECTORIZE"])
def test_settings_of_numba_are_part_of_the_name(setting, monkeypatch):
    stamps.forget_digests()
    types = (numba.float64,)
    before = squared.disk.name_of(types, squared.targetctx)
    monkeypatch.setattr(config, setting, 1 if getattr(config, setting) != 1 else 0)
    assert squared.disk.name_of(types, squared.targetctx) != before
    monkeypatch.undo()
    assert squared.disk.name_of(types, squared.targetctx) == before
    assert squared.inner.disk.name_of(types, squared.targetctx) != before
    assert squared.disk.name_of((numba.float32,), squared.targetctx) != before


def test_what_is_compiled_in_another_way_has_another_name(folder, monkeypatch):
    """An edit of this package forgets what it compiled before."""

    @lean_kernel
    def named(x):
        return x + 2.0

    assert named(1.0) == 3.0
    sig = named.signatures[0]
    before, _ = named.disk.name_of(sig, named.targetctx)
    assert any(before in file.name for file in folder.rglob("*.kernel"))
    monkeypatch.setattr(cache, "_COMPILED_BY", "an edit")
    assert named.disk.name_of(sig, named.targetctx)[0] != before

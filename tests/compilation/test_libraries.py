"""What is kept of machine code beside itself are the names that it defines, and no others."""

import llvmlite.binding as llvm

from entropy_explore_env.compilation.libraries import _names_alone

CODE = """
declare void @elsewhere()
@"größe.<1>" = global i32 7
define i64 @"a \\22b\\22"() {
    call void @elsewhere()
    ret i64 3
}
"""


def test_names_of_any_letters_are_kept_alone():
    kept = llvm.parse_bitcode(_names_alone(llvm.parse_assembly(CODE)))
    assert [function.name for function in kept.functions] == ['a "b"']
    assert [variable.name for variable in kept.global_variables] == ["größe.<1>"]

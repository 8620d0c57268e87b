# Writes HEADER with the macro CAIRN_BUILD: "g++ 12.2.0, Release, commit abcdef12+dirty". Run at build time by CMakeLists.txt.
cmake_minimum_required(VERSION 3.24...4.0)
set(commit "unknown")
execute_process(
    COMMAND git -C ${SOURCE_DIR} describe --always --dirty=+dirty --abbrev=8 --match= --exclude=*
    OUTPUT_VARIABLE described
    RESULT_VARIABLE failed
    ERROR_QUIET OUTPUT_STRIP_TRAILING_WHITESPACE)
if(NOT failed AND NOT described STREQUAL "")
    set(commit ${described})
endif()
file(CONFIGURE OUTPUT ${HEADER} CONTENT "#define CAIRN_BUILD \"@BUILD@, commit @commit@\"\n" @ONLY)

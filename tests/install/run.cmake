# One install test; see CMakeLists.txt. The scratch folder is made anew, so that nothing is left from an older run.
cmake_minimum_required(VERSION 3.24...4.0)

function(run)
    execute_process(COMMAND ${ARGN} COMMAND_ECHO STDOUT COMMAND_ERROR_IS_FATAL ANY)
endfunction()

set(prefix ${SCRATCH}/prefix)
set(outside ${CMAKE_CURRENT_LIST_DIR}/outside)
file(REMOVE_RECURSE ${SCRATCH})
file(MAKE_DIRECTORY ${SCRATCH})
run(${CMAKE_COMMAND} --install ${BUILD_DIR} --config ${CONFIG} --prefix ${prefix})

if(WAY STREQUAL "find_package")
    run(${CMAKE_COMMAND} -S ${outside} -B ${SCRATCH}/build -G ${GENERATOR} -DCMAKE_PREFIX_PATH=${prefix} -DCMAKE_C_COMPILER=${CC}
        -DCMAKE_CXX_COMPILER=${CXX} -DBULLET=${BULLET})
    run(${CMAKE_COMMAND} --build ${SCRATCH}/build)
    run(${SCRATCH}/build/fall)
    if(BULLET)
        run(${SCRATCH}/build/bullet_fall)
    endif()
else()
    if(NOT PKG_CONFIG)
        message(FATAL_ERROR "pkg-config was not found when this build was configured: install pkg-config and configure again")
    endif()
    # The installation is moved first: the .pc file must not depend on the place where it was made.
    file(RENAME ${prefix} ${SCRATCH}/moved)
    set(ENV{PKG_CONFIG_PATH} ${SCRATCH}/moved/${LIBDIR}/pkgconfig)
    execute_process(COMMAND ${PKG_CONFIG} --cflags --libs cairn OUTPUT_VARIABLE flags OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
    separate_arguments(flags UNIX_COMMAND "${flags}")
    run(${CC} -std=c99 -o ${SCRATCH}/fall ${outside}/fall.c ${flags})
    run(${CMAKE_COMMAND} -E env LD_LIBRARY_PATH=${SCRATCH}/moved/${LIBDIR} ${SCRATCH}/fall)
endif()

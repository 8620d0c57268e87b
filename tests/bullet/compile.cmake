# The adapter's sources in a user's build: one compiler, one standard, one precision. Arguments: CXX, STANDARD, FLAGS, SOURCES, all lists
# but the first two. The compiler only checks; it makes no code.
cmake_minimum_required(VERSION 3.24...4.0)
foreach(source IN LISTS SOURCES)
    execute_process(COMMAND ${CXX} -std=c++${STANDARD} -fsyntax-only -pedantic -Wall -Wextra -Wconversion -Wshadow -Werror ${FLAGS} ${source}
                    COMMAND_ECHO STDOUT RESULT_VARIABLE failed)
    if(failed)
        message(FATAL_ERROR "${source} does not compile as C++${STANDARD} with ${CXX}")
    endif()
endforeach()

# Sets cairn_with_cuda: whether gpu/ is built, by what CAIRN_CUDA asks for and what is found here.
set(cairn_with_cuda OFF)
if(NOT CAIRN_CUDA OR CAIRN_SANITIZE) # sanitizers know nothing of nvcc's code
    return()
endif()

if(NOT CMAKE_CUDA_COMPILER)
    unset(CMAKE_CUDA_COMPILER CACHE) # what an earlier run did not find may be there now
elseif(IS_ABSOLUTE "${CMAKE_CUDA_COMPILER}" AND NOT EXISTS "${CMAKE_CUDA_COMPILER}")
    message(FATAL_ERROR "This build folder's CUDA compiler is gone, ${CMAKE_CUDA_COMPILER}: delete ${CMAKE_BINARY_DIR} and configure again.")
endif()
if(NOT CMAKE_CUDA_HOST_COMPILER AND NOT DEFINED ENV{CUDAHOSTCXX})
    set(ENV{CUDAHOSTCXX} ${CMAKE_CXX_COMPILER}) # nvcc would take whatever is called g++, and its standard library
endif()
include(CheckLanguage)
check_language(CUDA)

if(NOT CMAKE_CUDA_COMPILER)
    set(problem "no nvcc that works was found (looked for on PATH and in CUDACXX; the reason is in the log in CMakeFiles/)")
else()
    enable_language(CUDA)
    if(CMAKE_CUDA_COMPILER_ID STREQUAL "NVIDIA" AND CMAKE_CUDA_COMPILER_VERSION VERSION_GREATER_EQUAL 12.0)
        find_package(CUDAToolkit REQUIRED)
        set(cairn_with_cuda ON)
        return()
    endif()
    set(problem "${CMAKE_CUDA_COMPILER} is ${CMAKE_CUDA_COMPILER_ID} ${CMAKE_CUDA_COMPILER_VERSION}, not an nvcc of 12.0 or newer")
endif()

set(remedy "install NVIDIA's CUDA toolkit, or run ./dev setup --cuda")
if(CAIRN_CUDA STREQUAL "AUTO")
    message(NOTICE "Building without CUDA: ${problem}. To have it, ${remedy}; -DCAIRN_CUDA=OFF ends this note.")
else()
    message(FATAL_ERROR "CAIRN_CUDA is ${CAIRN_CUDA}, but ${problem}: ${remedy}. -DCAIRN_CUDA=OFF builds without.")
endif()

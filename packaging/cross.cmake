# A Linux on another processor: PELLUCID_MACHINE names it, PELLUCID_TOOLS has compilers for it. packaging/wheels.sh sets both.
set(CMAKE_TRY_COMPILE_PLATFORM_VARIABLES PELLUCID_MACHINE PELLUCID_TOOLS)
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR ${PELLUCID_MACHINE})
set(CMAKE_C_COMPILER ${PELLUCID_TOOLS}/cc)
set(CMAKE_CXX_COMPILER ${PELLUCID_TOOLS}/c++)
set(CMAKE_AR ${PELLUCID_TOOLS}/ar)
set(CMAKE_RANLIB ${PELLUCID_TOOLS}/ranlib)
# The system's own strip knows no other processor.
set(CMAKE_STRIP true)
set(CMAKE_MODULE_LINKER_FLAGS_INIT -s)
set(CMAKE_EXE_LINKER_FLAGS_INIT -s)
# nanobind writes to stderr and leaves its declaration to Python.h, which does not include it for the stable ABI.
set(CMAKE_CXX_FLAGS_INIT "-include stdio.h -Wno-macro-redefined")

# One native module for several Pythons: the engine and its libraries once, the bindings once a Python, and an entry that picks
# them by the interpreter that asks.
#
# TALBOT_BUNDLE_PYTHONS: list of MAJOR.MINOR=INCLUDE_ROOT, where INCLUDE_ROOT/pythonMAJOR.MINOR/Python.h is.
#
# The bindings of two Pythons are the same names over other structures. So each Python's objects are joined into one whose only
# global name is its entry, and what they want of the interpreter is made weak: one Python has names that another lacks, and
# the entry never calls those of another.
set(joined "")
set(versions "")
foreach(python ${TALBOT_BUNDLE_PYTHONS})
  string(REPLACE "=" ";" pair ${python})
  list(GET pair 0 version)
  list(GET pair 1 root)
  string(REPLACE "." ";" numbers ${version})
  string(REPLACE ";" "," numbers "${numbers}")
  string(REPLACE "." "_" suffix ${version})
  string(APPEND versions " PYTHON(${numbers},PyInit__talbot_${suffix})")

  add_library(bindings_${suffix} OBJECT ${python_sources})
  target_include_directories(bindings_${suffix} SYSTEM PRIVATE ${TALBOT_PYBIND11} ${root} ${root}/python${version})
  target_link_libraries(bindings_${suffix} PRIVATE talbot_engine)
  # What is unique in the process cannot be made local to one object.
  target_compile_options(bindings_${suffix} PRIVATE ${TALBOT_WARNINGS} -fno-gnu-unique)
  target_compile_definitions(bindings_${suffix} PRIVATE TALBOT_VERSION="${PROJECT_VERSION}" PyInit__talbot=PyInit__talbot_${suffix}
    # pybind11 shares its tables among all modules that call themselves alike; these are for us alone.
    PYBIND11_COMPILER_TYPE="_talbot")
  set(object ${CMAKE_CURRENT_BINARY_DIR}/bindings_${suffix}.o)
  add_custom_command(OUTPUT ${object}
    COMMAND ${CMAKE_LINKER} -r --force-group-allocation -o ${object} $<TARGET_OBJECTS:bindings_${suffix}>
    COMMAND ${CMAKE_OBJCOPY} --keep-global-symbol=PyInit__talbot_${suffix} ${object}
    COMMAND ${CMAKE_OBJCOPY} --wildcard --weaken-symbol=Py[A-HJ-Z_]* --weaken-symbol=_Py* ${object}
    DEPENDS bindings_${suffix} $<TARGET_OBJECTS:bindings_${suffix}> COMMAND_EXPAND_LISTS VERBATIM)
  list(APPEND joined ${object})
endforeach()

set(here ${CMAKE_SOURCE_DIR}/packaging/bundle)
add_library(_talbot MODULE ${here}/entry.cpp ${here}/old_symbols.cpp ${here}/image_algorithms.cpp ${here}/thread_data.cpp ${joined})
set_target_properties(_talbot PROPERTIES PREFIX "" SUFFIX ".so")
target_compile_options(_talbot PRIVATE ${TALBOT_WARNINGS})
target_compile_definitions(_talbot PRIVATE "TALBOT_PYTHONS=${versions}")
target_link_libraries(_talbot PRIVATE talbot_engine)
target_link_options(_talbot PRIVATE -Wl,-Bsymbolic -Wl,--gc-sections -Wl,-z,now -Wl,-s
  # See old_symbols.cpp.
  -Wl,--wrap=hypot -Wl,--wrap=hypotf -Wl,--wrap=_ZNSt18condition_variable4waitERSt11unique_lockISt5mutexE)

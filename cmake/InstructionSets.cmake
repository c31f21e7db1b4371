# palpate_add_per_instruction_set(TARGET SOURCE… [FLAGS …]): compiles each source, with these flags,
# for what every processor of the architecture has and, on x86-64 with GCC or Clang, once more for
# AVX2 and for AVX-512. What such a source defines stands in the namespace PALPATE_LANES_SET of
# palpate/lanes/instruction_set.hpp; PALPATE_COMPILED_AVX2 and PALPATE_COMPILED_AVX512 say which
# there are, and the program chooses when it runs.
#
# No set gets -mfma: the same bits on every processor need the same roundings. AVX-512 has fused
# operations of its own, which -ffp-contract=off keeps the compiler from choosing.
include(CheckCXXSourceCompiles)

set(PALPATE_FLAGS_AVX2 -mavx2 -ffp-contract=off)
set(PALPATE_FLAGS_AVX512 -mavx512f -mavx512dq -mavx512vl -mavx512bw -mprefer-vector-width=512
                         -ffp-contract=off)

function(palpate_find_instruction_sets result)
  set(found)
  if(CMAKE_CXX_COMPILER_ID MATCHES "GNU|Clang" AND NOT MSVC)
    foreach(set IN ITEMS AVX2 AVX512)
      list(JOIN PALPATE_FLAGS_${set} " " CMAKE_REQUIRED_FLAGS)
      check_cxx_source_compiles(
        "#if !defined(__x86_64__)\n#error\n#endif\n#include <immintrin.h>\nint main() { return __builtin_cpu_supports(\"avx2\") < 0; }"
        PALPATE_COMPILES_${set})
      if(PALPATE_COMPILES_${set})
        list(APPEND found ${set})
      endif()
    endforeach()
  endif()
  set(${result} ${found} PARENT_SCOPE)
endfunction()

function(palpate_add_per_instruction_set target)
  cmake_parse_arguments(given "" "" "FLAGS" ${ARGN})
  set(sources ${given_UNPARSED_ARGUMENTS})
  palpate_find_instruction_sets(sets)
  target_sources(${target} PRIVATE ${sources})
  set_source_files_properties(${sources} PROPERTIES COMPILE_OPTIONS "${given_FLAGS}")
  foreach(set IN LISTS sets)
    target_compile_definitions(${target} PRIVATE PALPATE_COMPILED_${set})
    string(TOLOWER ${set} suffix)
    foreach(source IN LISTS sources)
      # A source has one set of flags: each further set needs a source of its own.
      cmake_path(ABSOLUTE_PATH source NORMALIZE OUTPUT_VARIABLE path)
      cmake_path(GET path STEM name)
      set(copy ${CMAKE_CURRENT_BINARY_DIR}/instruction_sets/${target}_${name}_${suffix}.cpp)
      file(CONFIGURE OUTPUT ${copy} CONTENT "#include \"@path@\"\n" @ONLY)
      set_source_files_properties(${copy} PROPERTIES COMPILE_OPTIONS
                                                     "${given_FLAGS};${PALPATE_FLAGS_${set}}")
      target_sources(${target} PRIVATE ${copy})
    endforeach()
  endforeach()
endfunction()

# palpate_add_lanes(TARGET [FLAG…]): the kernels of contacts in lanes, which
# src/lanes/compiled_kernels.hpp declares, with these flags too.
function(palpate_add_lanes target)
  set(flags)
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    # Ordered before registers are given out: 11, 4 and 5 % quicker with SSE2, AVX2 and AVX-512.
    set(flags -fschedule-insns -fsched-pressure)
  endif()
  palpate_add_per_instruction_set(${target} ${PROJECT_SOURCE_DIR}/src/lanes/kernels.cpp
                                  FLAGS ${flags} ${ARGN})
  target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR}/src/lanes)
endfunction()

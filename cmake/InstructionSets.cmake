# palpate_add_per_instruction_set(TARGET SOURCE): compiles a source for what every processor of the
# architecture has and, on x86-64 with GCC or Clang, once more for AVX2 and for AVX-512. What it
# defines stands in the namespace PALPATE_INSTRUCTION_SET of palpate/batch_fit/curve_kernels.hpp;
# PALPATE_COMPILED_AVX2 and PALPATE_COMPILED_AVX512 say which there are, and the program chooses when
# it runs.
#
# No set gets -mfma: the same bits on every processor need the same roundings. AVX-512 has fused
# operations of its own, which -ffp-contract=off keeps the compiler from choosing.
include(CheckCXXSourceCompiles)

set(PALPATE_FLAGS_AVX2 -mavx2 -ffp-contract=off)
set(PALPATE_FLAGS_AVX512 -mavx512f -mavx512dq -mavx512vl -mavx512bw -mprefer-vector-width=512
                         -ffp-contract=off)

function(palpate_add_per_instruction_set target source)
  target_sources(${target} PRIVATE ${source})
  if(MSVC OR NOT CMAKE_CXX_COMPILER_ID MATCHES "GNU|Clang")
    return()
  endif()
  cmake_path(ABSOLUTE_PATH source NORMALIZE OUTPUT_VARIABLE path)
  cmake_path(GET path STEM name)
  foreach(set IN ITEMS AVX2 AVX512)
    list(JOIN PALPATE_FLAGS_${set} " " CMAKE_REQUIRED_FLAGS)
    check_cxx_source_compiles(
      "#if !defined(__x86_64__)\n#error\n#endif\nint main() { return __builtin_cpu_supports(\"avx2\") < 0; }"
      PALPATE_COMPILES_${set})
    if(PALPATE_COMPILES_${set})
      # A source has one set of flags: each further set needs a source of its own.
      string(TOLOWER ${set} suffix)
      set(copy ${CMAKE_CURRENT_BINARY_DIR}/instruction_sets/${name}_${suffix}.cpp)
      file(CONFIGURE OUTPUT ${copy} CONTENT "#include \"@path@\"\n" @ONLY)
      set_source_files_properties(${copy} PROPERTIES COMPILE_OPTIONS "${PALPATE_FLAGS_${set}}")
      target_sources(${target} PRIVATE ${copy})
      target_compile_definitions(${target} PRIVATE PALPATE_COMPILED_${set})
    endif()
  endforeach()
endfunction()

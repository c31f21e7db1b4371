// The language of these headers, named before the errors of an older one.
#pragma once

#ifdef _MSVC_LANG
#define PALPATE_LANGUAGE _MSVC_LANG
#else
#define PALPATE_LANGUAGE __cplusplus
#endif
#if PALPATE_LANGUAGE < 201709L  // GCC 10 calls its C++20 so
#error "palpate needs C++20: compile with -std=c++20 (MSVC: /std:c++20), or CMAKE_CXX_STANDARD 20"
#endif
#undef PALPATE_LANGUAGE

#!/usr/bin/env bash
# Choosing faster code at run time in a plug-in that `zig cc` (PyPI: ziglang) builds for other computers.
#
# Guess, written before the run: zig cc is clang, so __builtin_cpu_supports("x86-64-v3") and functions with
# __attribute__((target("avx2"))) and a default version choose by the processor, as with clang and GCC.
#
# Seen (Linux, x86-64 with AVX2): both compile and link without a warning, and both always say no, even to SSE2, which
# every x86-64 has. Zig's own runtime gives __cpu_model and __cpu_indicator_init as stubs that are all zeros. So the
# default version runs, silently slower; the sound is right. CPUID and XGETBV, asked by hand (<cpuid.h>), do tell.
#
# Needs an x86-64 Linux with AVX2, python3 with venv, and a package index. Fails if the answers change.
set -euo pipefail
grep -qw avx2 /proc/cpuinfo || { echo "this processor has no AVX2"; exit 0; }
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet ziglang==0.17.1
cat >"$folder/asked.cpp" <<'C'
#include <cpuid.h>
#include <cstdio>
__attribute__((target("default"))) const char *chosen() { return "default"; }
__attribute__((target("avx2"))) const char *chosen() { return "avx2"; }
int main() {
  unsigned a, b, c, d;
  __builtin_cpu_init();
  __get_cpuid_count(7, 0, &a, &b, &c, &d);
  std::printf("sse2 %d, avx2 %d, v3 %d, version %s, CPUID's avx2 %d\n", !!__builtin_cpu_supports("sse2"),
              !!__builtin_cpu_supports("avx2"), !!__builtin_cpu_supports("x86-64-v3"), chosen(), !!(b & bit_AVX2));
}
C
ZIG_GLOBAL_CACHE_DIR="$folder/cache" "$folder/venv/bin/python" -m ziglang c++ -target x86_64-linux-gnu.2.17 -O2 -Werror \
  -o "$folder/asked" "$folder/asked.cpp"
echo "zig $("$folder/venv/bin/python" -m ziglang version)"
said=$("$folder/asked")
echo "$said"
test "$said" = "sse2 0, avx2 0, v3 0, version default, CPUID's avx2 1"

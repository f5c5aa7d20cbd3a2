// What L2 keeps of the buffers of a launch, and what the next launch finds: nvcc -arch=sm_90 -O3 -std=c++17, then
// ncu --clock-control none --cache-control none --metrics dram__bytes_read.sum,dram__bytes_write.sum: l2_pairs.csv.
#include <cstdio>
#include <cstdlib>
#include <cstring>
#define OK(x) do { cudaError_t err_ = (x); if (err_ != cudaSuccess) { printf("error %s line %d\n", cudaGetErrorString(err_), __LINE__); exit(1); } } while (0)
typedef unsigned long long u64;
struct Part { uint4* a; u64 quads; int store; };
// block j touches share j of every part, quads in order, parts side by side
__global__ void touch(Part p, Part q, Part r, unsigned* out) {
  unsigned sum = 0;
  Part parts[3] = {p, q, r};
  #pragma unroll
  for (int k = 0; k < 3; k++) {
    u64 from = parts[k].quads * blockIdx.x / gridDim.x, to = parts[k].quads * (blockIdx.x + 1) / gridDim.x;
    for (u64 i = from + threadIdx.x; i < to; i += blockDim.x) {
      if (parts[k].store) parts[k].a[i] = make_uint4(i, 1, 2, 3);
      else { uint4 v = parts[k].a[i]; sum += v.x ^ v.y ^ v.z ^ v.w; }
    }
  }
  if (sum == 0x12345u) *out = sum;
}
char* base; unsigned* out;
// "As32 Bl16": buffer A stored 32 MiB, B loaded 16 MiB
Part part(const char* s) {
  Part p; p.a = (uint4*)(base + (u64)(s[0] - 'A') * (512ull << 20)); p.quads = (u64)(atof(s + 2) * 65536); p.store = s[1] == 's'; return p;
}
void go(const char* text) {
  char copy[99]; strcpy(copy, text);
  Part p[3]; int n = 0; double most = 0;
  for (char* t = strtok(copy, " "); t; t = strtok(0, " ")) { p[n] = part(t); if (p[n].quads > most) most = p[n].quads; n++; }
  for (; n < 3; n++) { p[n] = p[0]; p[n].quads = 0; }
  int grid = (int)(most / 256) + 1;
  touch<<<grid, 256>>>(p[0], p[1], p[2], out);
  OK(cudaDeviceSynchronize());
}
int main() {
  OK(cudaMalloc(&base, 6ull << 30)); OK(cudaMalloc(&out, 64)); OK(cudaMemset(base, 0, 6ull << 30));
  const char* cases[][4] = {
    {"As16", "Al16"}, {"As32", "Al32"}, {"As36", "Al36"}, {"As40", "Al40"}, {"As48", "Al48"}, {"As64", "Al64"},
    {"As32 Bs8", "Al32"}, {"As32 Bs16", "Al32"}, {"As32 Bs32", "Al32"}, {"As16 Bs16", "Al16"}, {"As16 Bs32", "Al16"}, {"As16 Bs48", "Al16"}, {"As8 Bs64", "Al8"}, {"As8 Bs128", "Al8"},
    {"As32 Bl8", "Al32"}, {"As32 Bl32", "Al32"}, {"As16 Bl48", "Al16"}, {"As8 Bl64", "Al8"},
    {"As32", "Al32 Bs8"}, {"As32", "Al32 Bs32"}, {"As32", "Al32 Bs64"}, {"As16", "Al16 Bs32"}, {"As16", "Al16 Bs64"}, {"As24", "Al24 Bs8"}, {"As24", "Al24 Bs24"}, {"As24", "Al24 Bl24"}, {"As16", "Al16 Bl64"},
    {"As32 Bs32", "Al32 Cs8"}, {"As32 Bl8 Cl16", "Al32 Ds8"}, {"As32 Bl16 Cs16", "Al32 Ds8"},
    {"As16", "Bs8", "Al16"}, {"As16", "Bs16", "Al16"}, {"As16", "Bs24", "Al16"}, {"As16", "Bs32", "Al16"}, {"As16", "Bs64", "Al16"},
    {"As16", "Bl8", "Al16"}, {"As16", "Bl16", "Al16"}, {"As16", "Bl24", "Al16"}, {"As16", "Bl32", "Al16"}, {"As16", "Bl64", "Al16"}, {"As8", "Bl32", "Al8"}, {"As8", "Bs32", "Al8"},
    {"As32", "Bl32", "Bl32"}, {"As32", "Bl64", "Bl32"}, {"As48", "Bl16", "Bl16"}, {"Al32 Bs8", "Al32 Bs8", "Al32 Bs8"}, {"Al36 Bs8", "Al36 Bs8", "Al36 Bs8"}, {"Al40 Bs8", "Al40 Bs8", "Al40 Bs8"},
    {"As32", "As32", "As32"}, {"As40", "As40", "As40"}, {"As48", "As48", "As48"}, {"As48", "Bs8", "Bs8"}, {"As48", "Bs32", "Bs32"},
  };
  for (auto& c : cases) {
    go("Ll256"); go("Kl64");  // the cache is full of clean lines
    printf("case"); for (int i = 0; i < 4 && c[i]; i++) printf(",%s", c[i]); printf("\n");
    for (int i = 0; i < 4 && c[i]; i++) go(c[i]);
  }
  return 0;
}

// Additions without a value: a warp adds at nine words of a Gaussian, `lanes` of it at the same one (splat gradients).
// nvcc -arch=sm_90 -O3; prints a row a configuration.
#include <algorithm>
#include <cstdio>
// Warps add at a Gaussian a step, drawn anew; `shared_by` neighbouring warps at the same ones.
template<typename T> __global__ void red(T* base, int n, int steps, int lanes, int shared_by) {
  int warp = (blockIdx.x * blockDim.x + threadIdx.x) / 32, lane = threadIdx.x & 31;
  unsigned h = (warp / shared_by) * 2654435761u + 12345;
  for (int s = 0; s < steps; ++s) {
    h = h * 1664525u + 1013904223u;
    unsigned g = (h >> 8) % n;
    if (lane < lanes) {
      T v = (T)(lane + s);
      for (int k = 0; k < 9; ++k) atomicAdd(base + (size_t)k * n + g, v);
    }
  }
}
template<typename T> void go(const char* name) {
  int n = 1 << 17; T* p; cudaMalloc(&p, sizeof(T) * 9 * n); cudaMemset(p, 0, sizeof(T) * 9 * n);
  int blocks = 2048, threads = 256, steps = 64;
  for (int shared : {1, 8}) for (int lanes : {1, 2, 4, 8, 16, 32}) {
    float best = 1e9;
    for (int r = 0; r < 7; ++r) {
      cudaEvent_t a, b; cudaEventCreate(&a); cudaEventCreate(&b); cudaEventRecord(a);
      red<T><<<blocks, threads>>>(p, n, steps, lanes, shared);
      cudaEventRecord(b); cudaEventSynchronize(b); float ms; cudaEventElapsedTime(&ms, a, b); best = std::min(best, ms);
    }
    double instr = (double)blocks * threads / 32 * steps * 9;
    printf("%s,%d,%d,%.4f,%.3f,%.3f\n", name, shared, lanes, best, instr / best / 1e6, instr * lanes / best / 1e6);
  }
}
int main() { printf("type,warps sharing,lanes,ms,G instr/s,G lane ops/s\n"); go<float>("float"); go<unsigned>("u32"); printf("%s\n", cudaGetErrorString(cudaGetLastError())); }

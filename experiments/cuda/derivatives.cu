// The level of detail of a pixel shader two ways, to read what each costs from machine code:
//   nvcc -arch=sm_90 -cubin -o derivatives.cubin experiments/cuda/derivatives.cu
//   cuobjdump -sass derivatives.cubin
// Beyond what `neither` has, nvcc 13.0.88 gives `quads` 4 FADD, 6 SHFL and 3 LOP3, and `planes` 4 FFMA and 4 FMUL.
// A thread is a pixel, four threads a quad; u/w, v/w and 1/w are planes a x + b y + c over the screen (Zhang 2025).

struct Plane {
    float a, b, c;
};

__device__ float at(Plane p, float x, float y) {
    return fmaf(p.a, x, fmaf(p.b, y, p.c));
}

// Square of the longer derivative, in texels of the first level.
__device__ float step_of(float ux, float vx, float uy, float vy, float2 size) {
    float ax = ux * size.x, bx = vx * size.y, ay = uy * size.x, by = vy * size.y;
    return fmaxf(fmaf(ax, ax, bx * bx), fmaf(ay, ay, by * by));
}

// Coordinates and the perspective's w, which the shader needs in either case.
__device__ float3 coordinates(const Plane* planes, float x, float y) {
    float w = __frcp_rn(at(planes[0], x, y));
    return make_float3(at(planes[1], x, y) * w, at(planes[2], x, y) * w, w);
}

extern "C" __global__ void quads(const Plane* planes, float2 size, float* out) {
    int lane = threadIdx.x;
    float3 t = coordinates(planes, 2 * (lane >> 2) + (lane & 1) + 0.5f, ((lane >> 1) & 1) + 0.5f);
    float u0 = __shfl_sync(~0u, t.x, lane & ~3), v0 = __shfl_sync(~0u, t.y, lane & ~3);
    float u1 = __shfl_sync(~0u, t.x, lane & ~3 | 1), v1 = __shfl_sync(~0u, t.y, lane & ~3 | 1);
    float u2 = __shfl_sync(~0u, t.x, lane & ~3 | 2), v2 = __shfl_sync(~0u, t.y, lane & ~3 | 2);
    out[3 * lane] = step_of(u1 - u0, v1 - v0, u2 - u0, v2 - v0, size);
    out[3 * lane + 1] = t.x;
    out[3 * lane + 2] = t.y;
}

extern "C" __global__ void planes(const Plane* planes, float2 size, float* out) {
    int lane = threadIdx.x;
    float3 t = coordinates(planes, 2 * (lane >> 2) + (lane & 1) + 0.5f, ((lane >> 1) & 1) + 0.5f);
    float ux = fmaf(-t.x, planes[0].a, planes[1].a) * t.z, uy = fmaf(-t.x, planes[0].b, planes[1].b) * t.z;
    float vx = fmaf(-t.y, planes[0].a, planes[2].a) * t.z, vy = fmaf(-t.y, planes[0].b, planes[2].b) * t.z;
    out[3 * lane] = step_of(ux, vx, uy, vy, size);
    out[3 * lane + 1] = t.x;
    out[3 * lane + 2] = t.y;
}

// Neither: what both have besides.
extern "C" __global__ void neither(const Plane* planes, float2 size, float* out) {
    int lane = threadIdx.x;
    float3 t = coordinates(planes, 2 * (lane >> 2) + (lane & 1) + 0.5f, ((lane >> 1) & 1) + 0.5f);
    out[3 * lane] = step_of(t.x, t.y, t.z, t.x, size);
    out[3 * lane + 1] = t.x;
    out[3 * lane + 2] = t.y;
}

// copy_regions of mesh/kernels/regions.py for a GPU: one block of threads per region.

extern "C" __global__ void __launch_bounds__(THREADS, 1) copy_regions_kernel(PARAMETERS)
{
    const long long *region = table + (begin + blockIdx.x) * table_1;
    const long long nx = region[0], ny = region[1], nz = region[2], flips = region[3], cells = nx * ny * nz;
    for (long long n = threadIdx.x; n < cells * mirror_0; n += THREADS) {
        const long long variable = n / cells, x = n % nx, y = n / nx % ny, z = n / (nx * ny) % nz, axis = mirror[variable];
        const auto value = source[region[9] + variable * region[10] + z * region[13] + y * region[12] + x * region[11]];
        destination[region[4] + variable * region[5] + z * region[8] + y * region[7] + x] =
            axis >= 0 && flips >> axis & 1 ? -value : value;
    }
}

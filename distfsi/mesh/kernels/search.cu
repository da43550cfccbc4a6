// fill_cells of mesh/kernels/search.py for a GPU: one block of threads counts the particles of each cell, adds up, and fills.
// The particles of a cell come in any order here; order_cells sorts them.

extern "C" __global__ void __launch_bounds__(THREADS, 1) fill_cells_kernel(PARAMETERS)
{
    __shared__ long long sums[THREADS];
    unsigned long long *const end_of = (unsigned long long *)start;
    const long long me = threadIdx.x, each = (start_0 + THREADS - 1) / THREADS;
    const long long first = me * each, last = first + each < start_0 ? first + each : start_0;

    for (long long c = first; c < last; c++) start[c] = 0;
    __syncthreads();
    for (long long i = me; i < cell_0; i += THREADS) atomicAdd(end_of + cell[i], 1ull);
    __syncthreads();
    long long total = 0;
    for (long long c = first; c < last; c++) total += start[c];
    sums[me] = total;
    __syncthreads();
    total = 0;
    for (long long t = 0; t < me; t++) total += sums[t];
    for (long long c = first; c < last; c++) start[c] = total += start[c];
    __syncthreads();
    for (long long i = me; i < cell_0; i += THREADS) order[atomicAdd(end_of + cell[i], ~0ull) - 1] = i;
}

// The loops of fluid/kernels/stage.py and signals.py for a GPU: the same steps, one block of threads per tile, one thread per column of cells.
//
// Defined above: DIMENSIONS, PHASES, VARIABLES, FLUXES, GHOSTS, BISECTION_FALLBACK, ASYMMETRIC, SHARPENED, RADIAL, SHARES, TRANSVERSE_SENSOR; the
// formulas by their names, whose first argument are the `numbers` of the scene, NUMBERS; and for the stage
// TILE_X, TILE_Y (cells of a whole tile across the block's threads), THREADS, SHARED (values of shared memory).

// ---- tuples and arrays ------------------------------------------------------------------------------------------------

template <class... R> DEVICE Tuple<real, R...> joined(real first, Tuple<R...> rest) { return {first, rest}; }

// The N values from `values` on, `step` apart.
template <int N, int K = 0> DEVICE auto tuple_of(const real *values, int step = 1)
{
    if constexpr (K == N)
        return Tuple<>{};
    else
        return joined(values[K * step], tuple_of<N, K + 1>(values, step));
}

DEVICE void set(Tuple<>, real *, long long) {}

template <class... R> DEVICE void set(Tuple<real, R...> tuple, real *values, long long step)
{
    *values = tuple.head;
    set(tuple.tail, values + step, step);
}

DEVICE constexpr bool is_velocity(int v) { return v >= PHASES && v < PHASES + DIMENSIONS; }

// The variable that stands at position v when the velocity along `axis` comes first, and where variable v stands then.
DEVICE constexpr int variable_at(int v, int axis)
{
    return is_velocity(v) ? PHASES + (v - PHASES + axis) % DIMENSIONS : v;
}
DEVICE constexpr int position_of(int v, int axis)
{
    return is_velocity(v) ? PHASES + (v - PHASES + DIMENSIONS - axis) % DIMENSIONS : v;
}

#ifdef HAS_TILE_X

// ---- a tile in shared memory ------------------------------------------------------------------------------------------

constexpr int GY = DIMENSIONS > 1 ? GHOSTS : 0, GZ = DIMENSIONS > 2 ? GHOSTS : 0;
constexpr int PX = TILE_X + 2 * GHOSTS, PY = TILE_Y + 2 * GY, PLANE = PX * PY;
constexpr int SLOTS = DIMENSIONS > 2 ? 2 * GHOSTS : 1;  // planes of cells that are kept: those a flux along z reads
constexpr int SP = SLOTS * PLANE;
constexpr int ROW = TILE_X + 1;  // of faces
constexpr int FACES = ROW * (TILE_Y + (DIMENSIONS > 1 ? 1 : 0));
constexpr int CONSERVED = PHASES + DIMENSIONS + 1;
constexpr real MINIMUM_VOLUME = HALF;
constexpr int HALVINGS = 80;
constexpr int KEPT = DIMENSIONS > 2 && PHASES > 1 ? 3 * FLUXES * THREADS : 0;  // what registers do not hold
constexpr int APART = KEPT > 0 ? THREADS : 1;  // the values of a thread
static_assert(SHARED == VARIABLES * SP + FLUXES * FACES + KEPT && THREADS == TILE_X * TILE_Y, "as the launch assumes");

// P of a cell of the tile; k counts planes, of which the last SLOTS are there.
DEVICE int cell(int i, int j, int k) { return (SLOTS > 1 ? (k + SLOTS) % SLOTS : 0) * PLANE + (j + GY) * PX + i + GHOSTS; }

template <int AXIS> DEVICE int cell_along(int i, int j, int k, int steps)
{
    return cell(AXIS == 0 ? i + steps : i, AXIS == 1 ? j + steps : j, AXIS == 2 ? k + steps : k);
}

template <int AXIS> DEVICE real largest_jump(const real *p, int i, int j, int k)
{
    const real here = p[cell(i, j, k)];
    return maximum(magnitude(p[cell_along<AXIS>(i, j, k, 1)] - here), magnitude(here - p[cell_along<AXIS>(i, j, k, -1)]));
}

// The largest pressure difference between the face's two cells and those beside them.
template <int AXIS> DEVICE real jump_along_face(const real *p, int i, int j, int k)
{
    constexpr int FIRST = AXIS == 0 ? 1 : 0, SECOND = AXIS == 2 ? 1 : 2;
    const int ni = i + (AXIS == 0), nj = j + (AXIS == 1), nk = k + (AXIS == 2);
    real jump = maximum(largest_jump<FIRST>(p, i, j, k), largest_jump<FIRST>(p, ni, nj, nk));
    if constexpr (DIMENSIONS > 2)
        jump = maximum(jump, maximum(largest_jump<SECOND>(p, i, j, k), largest_jump<SECOND>(p, ni, nj, nk)));
    return jump;
}

// rows of the metrics, as in records.py
enum { LOW, HIGH, VOLUME, NEARNESS, TO_LOW, STRETCH };

// The metrics of a tile's columns of cells, from its first one on; rows are `size` apart.
struct Metrics {
    const real *values;
    long long size;
    __device__ __forceinline__ real operator()(int row, int i) const { return values[row * size + i]; }
};

// Area of face i of a row on a domain side, over that of a planar face; nx: cells of the tile along x.
template <int SIDE> DEVICE real face_size(Metrics metrics, int nx, int i)
{
    if constexpr (SIDE == 0) return metrics(LOW, 0) * metrics(VOLUME, 0);
    if constexpr (SIDE == 1) return metrics(HIGH, nx - 1) * metrics(VOLUME, nx - 1);
    return metrics(VOLUME, i);
}

DEVICE real density_at(const real *P, int c)
{
    if (PHASES == 1) return P[c];
    const real *a = P + (PHASES + DIMENSIONS + 1) * SP + c;
    real filled = a[0], rho = a[0] * P[c];
    for (int phase = 1; phase < PHASES - 1; phase++) {
        filled = filled + a[phase * SP];
        rho = rho + a[phase * SP] * P[phase * SP + c];
    }
    return rho + (1 - filled) * P[(PHASES - 1) * SP + c];
}

// fall[d] = g h of the body force along each axis.
DEVICE void find_falls(const auto &numbers, real dt, real x, real y, real z, real *fall)
{
    if constexpr (HYDROSTATIC) set(falls(numbers, dt, x, y, z), fall, 1);
}

// Increments of a variable from the low face of a cell to its mean and from there to its high face; `fall`: of find_falls.
template <int AXIS> DEVICE auto increments(const auto &numbers, const real *P, Metrics metrics, int variable, real fall, int i, int j, int k)
{
    const bool sharp = variable > PHASES + DIMENSIONS && variable < 2 * PHASES + DIMENSIONS;
    real values[2 * GHOSTS - 1];
#pragma unroll
    for (int n = 0; n < 2 * GHOSTS - 1; n++) values[n] = P[variable * SP + cell_along<AXIS>(i, j, k, n + 1 - GHOSTS)];
    const auto cells = tuple_of<2 * GHOSTS - 1>(values);
    if constexpr (RADIAL && AXIS == 0) {
        const auto along = reconstructed_in_r(numbers, cells, metrics(NEARNESS, i), metrics(NEARNESS, i + 1), metrics(TO_LOW, i));
        return SHARPENED && sharp ? sharpened(numbers, cells) : along;
    } else {
        if constexpr (HYDROSTATIC) {
            if (variable == PHASES + DIMENSIONS) {
                real densities[2 * GHOSTS - 1], found[2];
#pragma unroll
                for (int n = 0; n < 2 * GHOSTS - 1; n++) densities[n] = density_at(P, cell_along<AXIS>(i, j, k, n + 1 - GHOSTS));
                set(reconstructed(numbers, beyond_rest(numbers, cells, tuple_of<2 * GHOSTS - 1>(densities), fall)), found, 1);
                const real weight = HALF * fall * densities[GHOSTS - 1];
                found[0] += weight, found[1] += weight;
                return tuple_of<2>(found);
            }
        }
        return SHARPENED && sharp ? sharpened(numbers, cells) : reconstructed(numbers, cells);
    }
}

// Flux through the face between a cell and the next along AXIS; its velocity components are rotated. `rate`: faces of a
// cell * dt/h. Whether it was limited.
template <int AXIS>
DEVICE bool flux(const auto &numbers, const real *P, Metrics metrics, int i, int j, int k, real rate, const real *fall, real *F, int step)
{
    if constexpr (RADIAL && AXIS == 0) rate = rate * metrics(STRETCH, i + 1);
    real left[VARIABLES], right[VARIABLES], low_mean[VARIABLES], high_mean[VARIABLES], value[FLUXES];
    const int low = cell(i, j, k), high = cell_along<AXIS>(i, j, k, 1);
#pragma unroll
    for (int v = 0; v < VARIABLES; v++) {
        const int u = variable_at(v, AXIS);
        const real *W = P + u * SP;
        low_mean[v] = W[low], high_mean[v] = W[high];
        left[v] = W[low] + item<1>(increments<AXIS>(numbers, P, metrics, u, fall[AXIS], i, j, k));
        right[v] = W[high] - item<0>(increments<AXIS>(numbers, P, metrics, u, fall[AXIS], i + (AXIS == 0), j + (AXIS == 1), k + (AXIS == 2)));
    }
    real jump = 0;
    if constexpr (TRANSVERSE_SENSOR) jump = jump_along_face<AXIS>(P + (PHASES + DIMENSIONS) * SP, i, j, k);
    const auto L = tuple_of<VARIABLES>(left), R = tuple_of<VARIABLES>(right);
    set(face_flux(numbers, L, R, jump), F, step);
    for (int v = 0; v < FLUXES; v++) value[v] = F[v * step];
    const auto l = tuple_of<VARIABLES>(low_mean), r = tuple_of<VARIABLES>(high_mean);
    const auto f = tuple_of<FLUXES>(value);
    real c = minimum(sound_speed(numbers, L), sound_speed(numbers, R));
    if constexpr (ASYMMETRIC && !RADIAL) c = minimum(c, minimum(sound_speed(numbers, l), sound_speed(numbers, r)));
    if (!(limiter_indicator(numbers, l, r, f, c, rate) < 0) || is_admissible(numbers, l, r, f, rate)) return false;
    set(limited_flux(numbers, l, r, f, jump, rate), F, step);
    return true;
}

// P = primitives of plane k of the cells at U, with n x m cells and their ghosts.
DEVICE void load_plane(const auto &numbers, const real *U, real *P, int k, int n, int m, int tx, int ty, long long sy, long long sz, long long su)
{
    for (int j = ty - GY; j < m + GY; j += TILE_Y) {
        for (int i = tx - GHOSTS; i < n + GHOSTS; i += TILE_X) {
            const real *u = U + k * sz + j * sy + i;
            real state[VARIABLES];
#pragma unroll
            for (int v = 0; v < VARIABLES; v++) state[v] = u[v * su];
            set(primitives(numbers, tuple_of<VARIABLES>(state)), P + cell(i, j, k), SP);
        }
    }
}

// Whether a box of n x m x l cells at U holds one state: a part of the answer, for the cells of this thread.
DEVICE bool is_unlike(const real *U, const real *first, int n, int m, int l, int tx, int ty, long long sy, long long sz,
                      long long su)
{
    for (int v = 0; v < VARIABLES; v++) {
        const real value = first[v * su];
        for (int k = 0; k < l; k++)
            for (int j = ty; j < m; j += TILE_Y)
                for (int i = tx; i < n; i += TILE_X)
                    if (U[v * su + k * sz + j * sy + i] != value) return true;
    }
    return false;
}

// Add the flux through n faces of domain side SIDE, `step` apart, to what has left through it; and that of as many `rows`
// as are alike. Always in the same order.
template <int SIDE>
DEVICE void account(double *through, const real *F, Metrics metrics, int nx, int step, int n, int rows, double weight)
{
    for (int v = threadIdx.x; v < CONSERVED; v += THREADS) {
        const real *values = F + position_of(v, SIDE / 2) * FACES;
        real total = values[0];
        if constexpr (RADIAL) total = total * face_size<SIDE>(metrics, nx, 0);
#pragma unroll 1
        for (int i = 1; i < n; i++) {
            if constexpr (RADIAL)
                total = total + values[i * step] * face_size<SIDE>(metrics, nx, i);
            else
                total = total + values[i * step];
        }
#pragma unroll 1
        for (int row = 0; row < rows; row++) through[SIDE * CONSERVED + v] += total * weight;
    }
}

// U_new = one Runge-Kutta stage of a cell, relaxed to the end. (A template: not every scene has all these formulas.)
template <class... T> DEVICE void advance(const auto &numbers, Tuple<T...> before, Tuple<T...> now, Tuple<T...> W, auto D, real b, real dt,
                                          real *U_new, long long su)
{
    const auto state = updated(numbers, before, now, W, D, b, dt);
    if constexpr (!BISECTION_FALLBACK) {
        set(state, U_new, su);
    } else {
        real values[VARIABLES + 1];
        set(state, values, 1);
#pragma unroll
        for (int v = 0; v < VARIABLES; v++) U_new[v * su] = values[v];
        if (values[VARIABLES] >= 0) return;
        const auto start = before_relaxation(numbers, before, now, W, D, b, dt);
        const auto phases = item<0>(start);
        real *const fraction = U_new + (PHASES + DIMENSIONS + 1) * su;
        if constexpr (PHASES == 2) {
            auto range = range_of_change(numbers, phases);
#pragma unroll 1
            for (int n = 0; n < HALVINGS; n++) range = halved_range(numbers, phases, item<0>(range), item<1>(range));
            *fraction = fraction_after(numbers, before, item<1>(start) + HALF * (item<0>(range) + item<1>(range)));
        } else {
            // the range of pressures is halved, and for each pressure those of the growths of volumes
            const auto pressures = range_of_pressure(numbers, phases);
            real lowest = item<0>(pressures), highest = item<1>(pressures), changes[PHASES], moved[PHASES];
            set(item<1>(start), moved, 1);
#pragma unroll 1
            for (int n = 0; n < HALVINGS; n++) {
                const real y = HALF * (lowest + highest);
                auto growths = range_of_growths(numbers, phases);
#pragma unroll 1
                for (int m = 0; m < HALVINGS; m++) growths = halved_growths(numbers, phases, y, item<0>(growths), item<1>(growths));
                set(changes_between(numbers, phases, item<0>(growths), item<1>(growths)), changes, 1);
                real surplus = changes[0];
                for (int phase = 1; phase < PHASES; phase++) surplus = surplus + changes[phase];
                (surplus > 0 ? lowest : highest) = y;
            }
            for (int phase = 0; phase < PHASES; phase++) moved[phase] = moved[phase] + changes[phase];
            set(fractions_after(numbers, before, tuple_of<PHASES>(moved)), fraction, su);
        }
    }
}

// columns of the tile table
enum { BLOCK, X0, Y0, Z0, NX, NY, NZ, SIDES };

extern "C" __global__ void __launch_bounds__(THREADS, 1) advance_tiles_kernel(PARAMETERS)
{
    DYNAMIC_SHARED(shared);
    const auto numbers = NUMBERS;
    real *P = (real *)shared, *F = P + VARIABLES * SP;
    const int tx = threadIdx.x % TILE_X, ty = threadIdx.x / TILE_X;
    const long long sy = states_now_4, sz = sy * states_now_3, su = sz * states_now_2;
    const long long at = begin + blockIdx.x;
    const long long t = chosen[at], *tile = tiles_table + t * tiles_table_1;
    const int nx = tile[NX], ny = tile[NY], nz = tile[NZ], sides = tile[SIDES];
    const double *h = tiles_spacing + 3 * tile[BLOCK];
    const real dt = real(times_dt), step_x = real(times_dt / h[0]), step_y = real(times_dt / h[1]), step_z = real(times_dt / h[2]);
    const long long u0 = tile[BLOCK] * VARIABLES * su + tile[Z0] * sz + tile[Y0] * sy + tile[X0];

    Metrics metrics = {tiles_metrics, tiles_metrics_2};
    if constexpr (RADIAL) metrics.values += tile[BLOCK] * tiles_metrics_1 * tiles_metrics_2 + tile[X0];

    // whether a stage does the same to all cells of the tile
    const bool is_calm = tiles_calm[t];
    bool uniform = is_calm;
    if (!is_calm) {
        const real *corner = states_now + u0 - GZ * sz - GY * sy - GHOSTS;
        const bool unlike = is_unlike(corner, corner, nx + 2 * GHOSTS, ny + 2 * GY, nz + 2 * GZ, tx, ty, sy, sz, su)
                            || is_unlike(states_before + u0, states_before + u0, nx, ny, nz, tx, ty, sy, sz, su);
        uniform = __syncthreads_count(unlike) == 0;
        if constexpr (RADIAL) uniform = uniform && states_now[u0 + PHASES * su] == 0;
    }

    // what is computed of it, and what it stands for
    const int n = uniform ? 1 : nx, m = uniform ? 1 : ny, l = uniform ? 1 : nz, step = uniform ? 0 : 1;
    const int x_alike = uniform ? ny * nz : 1, y_alike = uniform ? nz : 1, z_alike = uniform ? ny : 1;
    const bool inside = tx < n && ty < m;
    double *out = tiles_through + t * 6 * CONSERVED;
    real own[3 * FLUXES], *const kept = KEPT > 0 ? F + FLUXES * FACES + threadIdx.x : own;
    // what leaves the cell, and the fluxes along z at its low and its high side
    real *const D = kept, *const low = kept + FLUXES * APART, *const high = low + FLUXES * APART;
    const real sides_of_cell = SHARES, rx = sides_of_cell * step_x, ry = sides_of_cell * step_y, rz = sides_of_cell * step_z;
    real fall[3] = {0, 0, 0};
    find_falls(numbers, dt, step_x, step_y, step_z, fall);
    int count = 0;  // faces at the low sides of the tile's cells whose flux this thread has limited

    // primitives of the first planes, and fluxes through the low side along z
    for (int k = -GZ; k < (GZ > 0 ? GZ : 1); k++) load_plane(numbers, states_now + u0, P, k, n, m, tx, ty, sy, sz, su);
    __syncthreads();
    if constexpr (DIMENSIONS > 2) {
        if (inside) count += flux<2>(numbers, P, metrics, tx, ty, -1, rz, fall, low, APART);
        if (sides & 16) {
            if (inside)
                for (int v = 0; v < FLUXES; v++) F[v * FACES + ty * ROW + tx] = low[v * APART];
            __syncthreads();
            for (int j = 0; j < m; j++) account<4>(out, F + j * ROW, metrics, nx, step, nx, z_alike, times_weight * step_z);
        }
        __syncthreads();
    }
    for (int k = 0; k < l; k++) {
        if constexpr (DIMENSIONS > 2) load_plane(numbers, states_now + u0, P, k + GHOSTS, n, m, tx, ty, sy, sz, su);
        // fluxes along x, and the first part of the divergence
        if (ty < m)
            for (int i = tx; i < n + 1; i += TILE_X)
                count += flux<0>(numbers, P, metrics, i - 1, ty, k, rx, fall, F + ty * ROW + i, FACES) && i < n;
        __syncthreads();
        if (inside) {
#pragma unroll
            for (int v = 0; v < FLUXES; v++) {
                const real *f = F + v * FACES + ty * ROW + tx;
                if constexpr (RADIAL) {
                    const real own = v == PHASES ? P[(PHASES + DIMENSIONS) * SP + cell(tx, ty, k)] : real(0);
                    D[v * APART] = (metrics(HIGH, tx) * (f[1] - own) - metrics(LOW, tx) * (f[0] - own)) * step_x;
                } else
                    D[v * APART] = (f[1] - f[0]) * step_x;
            }
        }
        for (int j = 0; j < m; j++) {
            if (sides & 1) account<0>(out, F + j * ROW, metrics, nx, step, 1, x_alike, times_weight * step_x);
            if (sides & 2) account<1>(out, F + j * ROW + n, metrics, nx, step, 1, x_alike, times_weight * step_x);
        }
        // fluxes along y
        if constexpr (DIMENSIONS > 1) {
            __syncthreads();
            if (tx < n)
                for (int j = ty; j < m + 1; j += TILE_Y)
                    count += flux<1>(numbers, P, metrics, tx, j - 1, k, ry, fall, F + j * ROW + tx, FACES) && j < m;
            __syncthreads();
            if (inside) {
#pragma unroll
                for (int v = 0; v < FLUXES; v++) {
                    const real *f = F + position_of(v, 1) * FACES + ty * ROW + tx;
                    D[v * APART] = D[v * APART] + (f[ROW] - f[0]) * step_y;
                }
            }
            if (sides & 4) account<2>(out, F, metrics, nx, step, nx, y_alike, times_weight * step_y);
            if (sides & 8) account<3>(out, F + m * ROW, metrics, nx, step, nx, y_alike, times_weight * step_y);
        }
        // fluxes through the high side along z, which are those of the next plane's low side
        if constexpr (DIMENSIONS > 2) {
            if (inside) {
                count += flux<2>(numbers, P, metrics, tx, ty, k, rz, fall, high, APART) && k < l - 1;
#pragma unroll
                for (int v = 0; v < FLUXES; v++)
                    D[v * APART] = D[v * APART] + (high[position_of(v, 2) * APART] - low[position_of(v, 2) * APART]) * step_z;
#pragma unroll
                for (int v = 0; v < FLUXES; v++) low[v * APART] = high[v * APART];
            }
            if ((sides & 32) && k == l - 1) {
                __syncthreads();
                if (inside)
                    for (int v = 0; v < FLUXES; v++) F[v * FACES + ty * ROW + tx] = high[v * APART];
                __syncthreads();
                for (int j = 0; j < m; j++) account<5>(out, F + j * ROW, metrics, nx, step, nx, z_alike, times_weight * step_z);
            }
        }
        // the new state
        if (inside) {
            const long long u = u0 + k * sz + ty * sy + tx;
            real before[VARIABLES], now[VARIABLES];
#pragma unroll
            for (int v = 0; v < VARIABLES; v++) before[v] = states_before[u + v * su], now[v] = states_now[u + v * su];
            if constexpr (FRACTIONAL) {
                const real volume = states_volumes[u - tile[BLOCK] * (VARIABLES - states_volumes_1) * su];
                const real concentration = 1 / maximum(volume, MINIMUM_VOLUME);
#pragma unroll
                for (int v = 0; v < FLUXES; v++) D[v * APART] = D[v * APART] * concentration;
            }
            const auto W = tuple_of<VARIABLES>(P + cell(tx, ty, k), SP);
            const auto divergence = tuple_of<FLUXES>(D, APART);
            advance(numbers, tuple_of<VARIABLES>(before), tuple_of<VARIABLES>(now), W, divergence, times_b, dt, states_after + u, su);
        }
        __syncthreads();
    }
    // whether the tile has stayed as it is; a uniform one gets its state everywhere
    bool unchanged = uniform;
    for (int v = 0; v < VARIABLES && uniform; v++) {
        const real value = states_after[u0 + v * su];
        unchanged = unchanged && states_now[u0 + v * su] == value && states_before[u0 + v * su] == value;
        for (int k = 0; k < nz && !is_calm; k++)
            for (int j = ty; j < ny; j += TILE_Y)
                for (int i = tx; i < nx; i += TILE_X) states_after[u0 + v * su + k * sz + j * sy + i] = value;
    }
    // how many faces were limited
    long long *counts = (long long *)shared;
    counts[threadIdx.x] = count;
    __syncthreads();
    if (threadIdx.x > 0) return;
    for (int thread = 0; thread < THREADS; thread++) tiles_limited[t] += counts[thread];
    tiles_stages[t] = unchanged ? tiles_stages[t] + 1 : 0;
}

#else

// ---- the fastest signal -----------------------------------------------------------------------------------------------

extern "C" __global__ void __launch_bounds__(THREADS, 1) fastest_signals_kernel(PARAMETERS)
{
    __shared__ real largest[THREADS];
    const auto numbers = NUMBERS;
    const long long sy = U_4, sz = sy * U_3, su = sz * U_2;
    const long long at = begin + blockIdx.x;
    const long long block = chosen[at], *extent = grid_extent + 3 * block, nx = extent[0], ny = extent[1], nz = extent[2];
    const double *h = grid_spacing + 3 * block;
    const real rates[3] = {real(1 / h[0]), real(1 / h[1]), real(1 / h[2])};
    const real *first = U + block * VARIABLES * su + (DIMENSIONS > 2 ? GHOSTS * sz : 0) + (DIMENSIONS > 1 ? GHOSTS * sy : 0) + GHOSTS;
    real most = 0, invalid = 0;
    for (long long cell = threadIdx.x; cell < nx * ny * nz; cell += THREADS) {
        const real *u = first + cell / (nx * ny) * sz + cell / nx % ny * sy + cell % nx;
        real state[VARIABLES];
#pragma unroll
        for (int v = 0; v < VARIABLES; v++) state[v] = u[v * su];
        const auto W = primitives(numbers, tuple_of<VARIABLES>(state));
        const real c = sound_speed(numbers, W);
        real w[VARIABLES];
        set(W, w, 1);
        real signal = (magnitude(w[PHASES]) + c) * rates[0];
        for (int d = 1; d < DIMENSIONS; d++) signal = signal + (magnitude(w[PHASES + d]) + c) * rates[d];
        real lightest = state[0];
        for (int phase = 1; phase < PHASES; phase++) lightest = minimum(lightest, state[phase]);
        signal = signal + (square_root(lightest) - square_root(lightest));
        most = maximum(most, signal);
        invalid = invalid + (signal - signal);
    }
    largest[threadIdx.x] = most + invalid;
    for (int half = THREADS / 2; half > 0; half /= 2) {
        __syncthreads();
        if (threadIdx.x < half) {
            const real mine = largest[threadIdx.x], other = largest[threadIdx.x + half];
            largest[threadIdx.x] = other <= mine || mine != mine ? mine : other;
        }
    }
    if (threadIdx.x == 0) fastest[block] = largest[0];
}

#endif

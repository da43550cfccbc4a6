// What emitted CUDA C needs: integers, arrays and tuples with the meanings that Python gives them.
// `real` is defined above.

namespace distfsi {

#define DEVICE static __device__ __forceinline__

template <class A, class B> struct Same { static constexpr bool value = false; };
template <class A> struct Same<A, A> { static constexpr bool value = true; };

// ---- integers: 64 bits; with a real of any size they make a double ----------------------------------------------------

struct integer {
    long long value;
    integer() = default;
    __device__ constexpr integer(long long v) : value(v) {}
    __device__ constexpr operator long long() const { return value; }
};

#define ARITHMETIC(OP) \
    DEVICE integer operator OP(integer a, integer b) { return a.value OP b.value; } \
    DEVICE double operator OP(integer a, double b) { return (double)a.value OP b; } \
    DEVICE double operator OP(double a, integer b) { return a OP (double)b.value; } \
    DEVICE double operator OP(integer a, float b) { return (double)a.value OP (double)b; } \
    DEVICE double operator OP(float a, integer b) { return (double)a OP (double)b.value; }
ARITHMETIC(+)
ARITHMETIC(-)
ARITHMETIC(*)
#undef ARITHMETIC

DEVICE double operator/(integer a, integer b) { return (double)a.value / (double)b.value; }
template <class T> DEVICE double operator/(integer a, T b) { return (double)a.value / (double)b; }
template <class T> DEVICE double operator/(T a, integer b) { return (double)a / (double)b.value; }

#define COMPARISON(OP) \
    DEVICE bool operator OP(integer a, integer b) { return a.value OP b.value; } \
    DEVICE bool operator OP(integer a, double b) { return (double)a.value OP b; } \
    DEVICE bool operator OP(double a, integer b) { return a OP (double)b.value; } \
    DEVICE bool operator OP(integer a, float b) { return (double)a.value OP (double)b; } \
    DEVICE bool operator OP(float a, integer b) { return (double)a OP (double)b.value; }
COMPARISON(<)
COMPARISON(<=)
COMPARISON(>)
COMPARISON(>=)
COMPARISON(==)
COMPARISON(!=)
#undef COMPARISON

DEVICE integer operator-(integer a) { return -a.value; }
DEVICE integer operator&(integer a, integer b) { return a.value & b.value; }
DEVICE integer operator|(integer a, integer b) { return a.value | b.value; }
DEVICE integer operator<<(integer a, integer b) { return a.value << b.value; }
DEVICE integer operator>>(integer a, integer b) { return a.value >> b.value; }
DEVICE integer &operator+=(integer &a, integer b) { a.value += b.value; return a; }

DEVICE integer floor_divided(integer a, integer b)
{
    const long long quotient = a.value / b.value, rest = a.value % b.value;
    return rest != 0 && (rest < 0) != (b.value < 0) ? quotient - 1 : quotient;
}

DEVICE integer modulo(integer a, integer b)
{
    const long long rest = a.value % b.value;
    return rest != 0 && (rest < 0) != (b.value < 0) ? rest + b.value : rest;
}

// ---- what a value of an array or an operation of two types becomes ----------------------------------------------------

template <class T> struct Widened { typedef integer type; };
template <> struct Widened<double> { typedef double type; };
template <> struct Widened<float> { typedef float type; };
template <> struct Widened<bool> { typedef bool type; };

template <class A, class B> struct Common { typedef double type; };
template <class A> struct Common<A, A> { typedef A type; };

// A name keeps its type: a wider value would be cut off without a word.
template <class A, class B> DEVICE void assign(A &name, B value)
{
    static_assert(Same<typename Common<A, B>::type, A>::value, "a name gets a value of another type");
    name = value;
}

// ---- arrays -----------------------------------------------------------------------------------------------------------

template <class T, int N> struct Array {
    T *data;
    integer shape[N];

    __device__ __forceinline__ integer size() const
    {
        long long values = 1;
        for (int axis = 0; axis < N; axis++) values *= shape[axis].value;
        return values;
    }
    template <class... I> __device__ __forceinline__ long long flat(I... index) const
    {
        const long long place[] = {(long long)index...};
        long long flat = place[0];
        for (int axis = 1; axis < N; axis++)
            flat = flat * shape[axis].value + (axis < int(sizeof...(I)) ? place[axis < int(sizeof...(I)) ? axis : 0] : 0);
        return flat;
    }
    template <class... I> __device__ __forceinline__ T &at(I... index) const
    {
        static_assert(sizeof...(I) == N, "one index per axis");
        return data[flat(index...)];
    }
    // A value, or with fewer indices than axes the array of the rest.
    template <class... I> __device__ __forceinline__ auto operator()(I... index) const
    {
        if constexpr (sizeof...(I) == N) {
            return (typename Widened<T>::type)data[flat(index...)];
        } else {
            Array<T, N - int(sizeof...(I))> rest;
            rest.data = data + flat(index...);
            for (int axis = int(sizeof...(I)); axis < N; axis++) rest.shape[axis - int(sizeof...(I))] = shape[axis];
            return rest;
        }
    }
};

template <class T, int N> DEVICE typename Widened<T>::type load(Array<T, N> array, integer place)
{
    return array.data[place.value];
}

template <class T, int N, class V> DEVICE void store(Array<T, N> array, integer place, V value)
{
    array.data[place.value] = (T)value;
}

template <class T, int N> DEVICE integer length(Array<T, N> array) { return array.shape[0]; }

// ---- tuples -----------------------------------------------------------------------------------------------------------

template <class... T> struct Tuple {};
template <class H, class... R> struct Tuple<H, R...> {
    H head;
    Tuple<R...> tail;

    // Of values of one type, by an index known at run time only.
    __device__ __forceinline__ H operator()(long long index) const
    {
        if constexpr (sizeof...(R) == 0)
            return head;
        else
            return index == 0 ? head : tail(index - 1);
    }
};

DEVICE Tuple<> pack() { return {}; }
template <class H, class... R> DEVICE Tuple<H, R...> pack(H head, R... rest) { return {head, pack(rest...)}; }

template <int K, class H, class... R> DEVICE auto item(Tuple<H, R...> tuple)
{
    if constexpr (K == 0)
        return tuple.head;
    else
        return item<K - 1>(tuple.tail);
}

template <int K, class T, int N> DEVICE auto item(Array<T, N> array) { return array(K); }

// ---- mathematics ------------------------------------------------------------------------------------------------------

// Of NaN and a number, the second one. fmin and fmax choose otherwise.
template <class A, class B> DEVICE auto minimum(A a, B b)
{
    typedef typename Common<A, B>::type type;
    return a < b ? (type)a : (type)b;
}

template <class A, class B> DEVICE auto maximum(A a, B b)
{
    typedef typename Common<A, B>::type type;
    return a > b ? (type)a : (type)b;
}

DEVICE double magnitude(double x) { return fabs(x); }
DEVICE float magnitude(float x) { return fabsf(x); }
DEVICE integer magnitude(integer x) { return x.value < 0 ? -x.value : x.value; }
DEVICE double square_root(double x) { return sqrt(x); }
DEVICE float square_root(float x) { return sqrtf(x); }
DEVICE double square_root(integer x) { return sqrt((double)x.value); }
DEVICE double logarithm(double x) { return log(x); }
DEVICE float logarithm(float x) { return logf(x); }
DEVICE double power(double x, double y) { return pow(x, y); }
DEVICE float power(float x, float y) { return powf(x, y); }
DEVICE double power(double x, float y) { return pow(x, (double)y); }
DEVICE double power(float x, double y) { return pow((double)x, y); }
DEVICE integer floored(double x) { return (long long)floor(x); }
DEVICE integer floored(float x) { return (long long)floorf(x); }
DEVICE integer truncated(double x) { return (long long)x; }
DEVICE integer truncated(float x) { return (long long)x; }
DEVICE integer truncated(integer x) { return x; }
DEVICE real infinity() { return sizeof(real) == 8 ? (real)__longlong_as_double(0x7ff0000000000000) : (real)__int_as_float(0x7f800000); }

// EXP_NUMBERS

DEVICE double two_to_the(double shifted) { return __longlong_as_double((__double_as_longlong(shifted) << 52) + (1023LL << 52)); }
DEVICE float two_to_the(float shifted) { return __int_as_float((__float_as_int(shifted) << 23) + (127 << 23)); }

// exp(x) with the same bits on every device (device/exponential.py)
DEVICE real exponential(real x)
{
    x = x < EXP_LOWEST ? EXP_LOWEST : x;
    x = x > EXP_HIGHEST ? EXP_HIGHEST : x;
    const real shifted = x * EXP_PER_TWO + EXP_SHIFT;
    const real n = shifted - EXP_SHIFT;
    const real r = (x - n * EXP_HIGH) - n * EXP_LOW;
    real total = EXP_COEFFICIENTS[0];
#pragma unroll
    for (int k = 1; k < int(sizeof(EXP_COEFFICIENTS) / sizeof(real)); k++) total = total * r + EXP_COEFFICIENTS[k];
    return total * two_to_the(shifted);
}

// ---- threads ----------------------------------------------------------------------------------------------------------

DEVICE integer thread_number() { return (long long)blockIdx.x * blockDim.x + threadIdx.x; }
DEVICE integer thread_count() { return (long long)gridDim.x * blockDim.x; }

}  // namespace distfsi

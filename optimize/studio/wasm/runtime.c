/* What the compiled kernels call: memory that is taken in order and never freed, 128-bit products,
   and functions of Numba's runtime for Python's errors, which the kernels do not raise. */

typedef unsigned long long u64;
typedef long long i64;

extern unsigned char __heap_base;
static unsigned top = 0;

/* Free all memory from an address on; 0 frees everything. */
__attribute__((export_name("rewind"))) void rewind(unsigned address) {
  top = address ? address : (unsigned)&__heap_base;
}

__attribute__((export_name("take"))) void *take(unsigned bytes) {
  unsigned here = ((top ? top : (unsigned)&__heap_base) + 63) & ~63u;
  top = here + bytes;
  unsigned pages = (top + 65535) / 65536, present = __builtin_wasm_memory_size(0);
  if (pages > present && __builtin_wasm_memory_grow(0, pages - present + 16) == -1u)
    __builtin_trap();
  return (void *)here;
}

typedef struct { i64 references; void *destructor, *argument, *data; i64 size; void *outside; } MemInfo;

void *NRT_MemInfo_alloc_aligned(i64 size, int align) {
  MemInfo *info = take(sizeof(MemInfo));
  *info = (MemInfo){1, 0, 0, take(size), size, 0};
  return info;
}
void *NRT_MemInfo_alloc(i64 size) { return NRT_MemInfo_alloc_aligned(size, 0); }
void *NRT_Allocate(i64 size) { return take(size); }
void NRT_MemInfo_call_dtor(void *info) {}
void NRT_Free(void *pointer) {}
char atomic_sub_cc(i64 *counter, i64 number, int order) { return (*counter -= number) == 0; }

void __multi3(u64 *result, u64 a, u64 a_high, u64 b, u64 b_high) {
  u64 a0 = a & 0xffffffff, a1 = a >> 32, b0 = b & 0xffffffff, b1 = b >> 32;
  u64 p00 = a0 * b0, p01 = a0 * b1, p10 = a1 * b0, p11 = a1 * b1;
  u64 middle = (p00 >> 32) + (p01 & 0xffffffff) + (p10 & 0xffffffff);
  result[0] = (p00 & 0xffffffff) | (middle << 32);
  result[1] = p11 + (p01 >> 32) + (p10 >> 32) + (middle >> 32) + a * b_high + a_high * b;
}

/* Strides of a reshaped array; all that are reshaped here are contiguous. */
int numba_attempt_nocopy_reshape(i64 axes, const i64 *sizes, const i64 *strides, i64 new_axes,
                                 const i64 *new_sizes, i64 *new_strides, i64 item, int is_fortran) {
  for (i64 k = new_axes - 1, stride = item; k >= 0; stride *= new_sizes[k--]) new_strides[k] = stride;
  return 1;
}

void *PyExc_RuntimeError;
void numba_gil_ensure(void *state) {}
void numba_gil_release(void *state) {}
void *PyUnicode_FromString(void *text) { return 0; }
void PyErr_WriteUnraisable(void *object) {}
void Py_DecRef(void *object) {}
void PyErr_Clear(void) {}
void *PyBytes_FromStringAndSize(void *bytes, i64 size) { return 0; }
void *numba_unpickle(void *data, int size, void *digest) { return 0; }
void PyErr_SetString(void *kind, void *text) {}
void *numba_runtime_build_excinfo_struct(void *values, void *types) { return 0; }
void numba_do_raise(void *error) {}
void PyErr_SetNone(void *kind) {}

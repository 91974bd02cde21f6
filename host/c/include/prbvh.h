/* prbvh for C. Made from host/c/src by `cargo run -p prbvh-c --example header`; docs/bindings.md explains it. */

#ifndef PRBVH_H
#define PRBVH_H

#include <stddef.h>
#include <stdint.h>

// How a call ended.
enum PrbvhStatus
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // There is a tree.
  PRBVH_STATUS_OK = 0,
  // A pointer is NULL or not aligned, a size too small, an option out of range.
  PRBVH_STATUS_INVALID_ARGUMENT = 1,
  // No primitives or too many, an index out of range, a coordinate that is not finite, a box that ends before it starts.
  PRBVH_STATUS_INVALID_GEOMETRY = 2,
  // There is no such device.
  PRBVH_STATUS_NO_DEVICE = 3,
  // The device has not the memory.
  PRBVH_STATUS_OUT_OF_MEMORY = 4,
  // The device refused or failed.
  PRBVH_STATUS_DEVICE_FAILED = 5,
  // A mistake of the library.
  PRBVH_STATUS_INTERNAL = 6,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum PrbvhStatus PrbvhStatus;
#else
typedef int32_t PrbvhStatus;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Where it runs.
enum PrbvhDevice
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // The best GPU there is, else the CPU.
  PRBVH_DEVICE_AUTO = 0,
  // The CPU.
  PRBVH_DEVICE_CPU = 1,
  // The best Vulkan device.
  PRBVH_DEVICE_VULKAN = 2,
  // The Vulkan device with the number `device_index`.
  PRBVH_DEVICE_VULKAN_INDEX = 3,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum PrbvhDevice PrbvhDevice;
#else
typedef uint32_t PrbvhDevice;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Which tree is optimised.
enum PrbvhInitial
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // LBVH: along a Morton curve.
  PRBVH_INITIAL_LBVH = 0,
  // PLOC: neighbours along the curve merge.
  PRBVH_INITIAL_PLOC = 1,
  // Binned SAH, on the CPU.
  PRBVH_INITIAL_SAH_BINNED = 2,
  // SAH over all splits, on the CPU.
  PRBVH_INITIAL_SAH_SWEEP = 3,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum PrbvhInitial PrbvhInitial;
#else
typedef uint32_t PrbvhInitial;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// What makes the tree better.
enum PrbvhOptimizer
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // PRBVH: reinsertions, the worst nodes first.
  PRBVH_OPTIMIZER_PRBVH = 0,
  // RBVH: reinsertions one after another, on one thread of the CPU.
  PRBVH_OPTIMIZER_RBVH = 1,
  // Rotations.
  PRBVH_OPTIMIZER_ROTATIONS = 2,
  // Nothing: the initial tree comes out.
  PRBVH_OPTIMIZER_NONE = 3,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum PrbvhOptimizer PrbvhOptimizer;
#else
typedef uint32_t PrbvhOptimizer;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Why a run ended.
enum PrbvhStop
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // Nothing more is to be gained.
  PRBVH_STOP_CONVERGED = 0,
  // `max_iterations`.
  PRBVH_STOP_MAX_ITERATIONS = 1,
  // `max_seconds`.
  PRBVH_STOP_MAX_SECONDS = 2,
  // `target_cost`.
  PRBVH_STOP_TARGET_COST = 3,
  // `progress` ended it.
  PRBVH_STOP_CANCELLED = 4,
  // Something else.
  PRBVH_STOP_OTHER = 5,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum PrbvhStop PrbvhStop;
#else
typedef uint32_t PrbvhStop;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// How far a run is.
typedef struct PrbvhProgress {
  // sizeof(PrbvhProgress) of the library.
  size_t size;
  // Iteration; 0 is the initial tree.
  uint32_t iteration;
  // Always 0.
  uint32_t reserved;
  // Seconds since the optimiser started.
  double seconds;
  // SAH cost now, one primitive per leaf.
  double cost;
} PrbvhProgress;

// Is told each iteration, on the thread that called. What it returns goes on where it is 0, and else ends the run with the best tree so far.
// It must come back: no longjmp, no exception.
typedef int (*PrbvhProgressFn)(void *user, const struct PrbvhProgress *progress);

// Options. All zeros but for the size are the defaults:
//
// PrbvhOptions options = {0};
// options.size = sizeof options;
typedef struct PrbvhOptions {
  // sizeof(PrbvhOptions): which version of it this is. What a library does not know must be 0.
  size_t size;
  // A PrbvhDevice.
  uint32_t device;
  // For PRBVH_DEVICE_VULKAN_INDEX.
  uint32_t device_index;
  // Threads of the CPU; 0: one per core. They end with the call.
  uint32_t threads;
  // A PrbvhInitial; not looked at where there is an `initial_name`.
  uint32_t initial;
  // Most iterations; 0: those of the library.
  uint32_t max_iterations;
  // Most primitives of a leaf; 0 and 1: one in each. More where that costs less.
  uint32_t max_leaf;
  // Most links from the root to a leaf; 0: 63, UINT32_MAX: any.
  uint32_t max_depth;
  // A PrbvhOptimizer.
  uint32_t optimizer;
  // No iteration starts after so many seconds; 0: no limit.
  double max_seconds;
  // No iteration starts at this cost or less; 0: no target.
  double target_cost;
  // Is told each iteration and may end the run; or NULL.
  PrbvhProgressFn progress;
  // For `progress`.
  void *user;
  // Which tree is optimised, by its name with parameters as the command has it: "hploc", "kmeans:q3", "aac:delta=8,epsilon=0.15". NULL: `initial`.
  const char *initial_name;
} PrbvhOptions;

// A node, 32 bytes; the root is the first. Children come after their parents.
typedef struct PrbvhNode {
  // Smallest corner of the box.
  float min[3];
  // count = 0: the left child, whose sibling is the next node. Else a leaf: its first place in the order of primitives.
  uint32_t first;
  // Largest corner of the box.
  float max[3];
  // Primitives of a leaf; 0: it is none.
  uint32_t count;
} PrbvhNode;

// What came out. Set the size before the call:
//
// PrbvhResult result = {0};
// result.size = sizeof result;
typedef struct PrbvhResult {
  // sizeof(PrbvhResult): which version of it this is.
  size_t size;
  // Nodes of the tree, 2n-1 at the most.
  size_t node_count;
  // A PrbvhStop.
  uint32_t stop;
  // Iterations.
  uint32_t iterations;
  // Most links from the root to a leaf.
  uint32_t max_depth;
  // Always 0.
  uint32_t reserved;
  // SAH cost of the initial tree: 3 for a visit of a node, 2 for a test of a primitive.
  double initial_cost;
  // SAH cost of the tree.
  double cost;
  // Seconds of all.
  double seconds;
} PrbvhResult;

// A box: smallest and largest corner.
typedef struct PrbvhBox {
  // Smallest x, y, z.
  float min[3];
  // Largest x, y, z.
  float max[3];
} PrbvhBox;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Builds a tree over triangles and optimises it.
//
// `vertices`: x, y, z of each of `vertex_count` vertices. `indices`: three vertices of each of `triangle_count` triangles; or NULL, then
// triangle k has vertices 3k, 3k+1 and 3k+2. `options` may be NULL: the defaults. Room for 2n-1 nodes in `nodes` and for n ids in
// `order`, n = `triangle_count`. `result` may be NULL.
//
// Returns PRBVH_STATUS_OK and a tree, also where a limit or the progress function ended the run early; or what went wrong, with nothing
// written.
//
// # Safety
// Each pointer is NULL or leads to as much as is said above, which nobody else writes before the function returns; the arrays that are written
// overlap no other.
PrbvhStatus prbvh_optimize_triangles(const float *vertices,
                                     size_t vertex_count,
                                     const uint32_t *indices,
                                     size_t triangle_count,
                                     const struct PrbvhOptions *options,
                                     struct PrbvhNode *nodes,
                                     uint32_t *order,
                                     struct PrbvhResult *result);

// Builds a tree over boxes and optimises it: particles, instances, objects.
//
// `boxes`: `box_count` of them. Else as `prbvh_optimize_triangles`.
//
// # Safety
// As there.
PrbvhStatus prbvh_optimize_boxes(const struct PrbvhBox *boxes,
                                 size_t box_count,
                                 const struct PrbvhOptions *options,
                                 struct PrbvhNode *nodes,
                                 uint32_t *order,
                                 struct PrbvhResult *result);

// Version of the library, as in "0.1.0"; it stays.
const char *prbvh_version(void);

// What a status means, for any number; it stays.
const char *prbvh_error_text(int32_t status);

// What went wrong in the last call of this thread, with names and numbers; empty if nothing did. Stays until the thread's next call.
const char *prbvh_last_error(void);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* PRBVH_H */

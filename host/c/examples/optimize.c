/* Boxes in, a tree out, and a walk through it. */
#include "prbvh.h"
#include <stdio.h>
#include <stdlib.h>

#define SIDE 40
#define COUNT (SIDE * SIDE)

static int told(void *user, const PrbvhProgress *progress) {
    (void)user;
    printf("iteration %u: cost %.2f\n", (unsigned)progress->iteration, progress->cost);
    return 0; /* anything else ends the run with the best tree so far */
}

int main(void) {
    static PrbvhBox boxes[COUNT];
    static PrbvhNode nodes[2 * COUNT - 1];
    static uint32_t order[COUNT];
    for (int k = 0; k < COUNT; k++) {
        float x = (float)(k % SIDE), y = (float)(k / SIDE);
        boxes[k] = (PrbvhBox){{x, y, 0.0f}, {x + 0.8f, y + 0.8f, (float)(k % 7)}};
    }
    PrbvhOptions options = {0};
    options.size = sizeof options;
    options.device = PRBVH_DEVICE_CPU;
    options.progress = told;
    PrbvhResult result = {0};
    result.size = sizeof result;
    PrbvhStatus status = prbvh_optimize_boxes(boxes, COUNT, &options, nodes, order, &result);
    if (status != PRBVH_STATUS_OK) {
        fprintf(stderr, "%s: %s\n", prbvh_error_text(status), prbvh_last_error());
        return EXIT_FAILURE;
    }
    size_t found = 0; /* primitives in the leaves */
    for (size_t k = 0; k < result.node_count; k++)
        found += nodes[k].count;
    printf("%zu nodes over %zu boxes, depth %u, cost %.2f instead of %.2f\n", result.node_count, found,
           (unsigned)result.max_depth, result.cost, result.initial_cost);
    return found == COUNT ? EXIT_SUCCESS : EXIT_FAILURE;
}

//! The table of kernels: each row makes a SPIR-V entry point, its [`KernelInfo`](crate::KernelInfo) and its native entry.
//!
//! A row names the kernel (variant of [`Kernel`] and SPIR-V entry point), its push constants, its buffers in the order of their
//! bindings with what it may do to them (see [`crate::mem`]), and the function that one invocation runs; with `shared` memory, the number of its words, and the
//! function that a workgroup runs (see [`crate::workgroup`]). A `#[cfg]` on a row leaves the kernel out.

use crate::aabb::Aabb;
#[cfg(feature = "atrbvh")]
use crate::atrbvh::{self, LevelsParams, RestructureParams};
use crate::collapse::widen::{WidenParams, widen};
use crate::collapse::{self, CollapseParams, CompactNode, EmitParams, Place, PlacesParams};
use crate::cost::{self, CostParams};
use crate::entry::kernels;
#[cfg(target_arch = "spirv")]
use crate::grid;
use crate::hploc::{self, HplocParams};
use crate::kept::{self, AtomicKept, Graft, GraftParams as KeptGraftParams, Kept, RestoreParams};
use crate::kmeans::{self, AssignParams, CentresParams, Frame, HalveParams, JoinParams, MeansParams, Part, Point};
use crate::kmeans::{RelabelParams, TallyParams};
use crate::lbvh::{self, HierarchyParams, LeavesParams};
use crate::mem::{AtomicU32, AtomicU64, Slot};
use crate::morton::{self, MortonParams};
use crate::node::{AtomicNode, Node, WideNode};
use crate::ploc::merge::{self, MergeParams};
use crate::ploc::nearest::{NearestParams, nearest};
use crate::ploc::{self, Cluster, ClustersParams, Progress};
use crate::prbvh::check::{check, check_words};
use crate::prbvh::dual::search::DualParams;
use crate::prbvh::lock::{lock, lock_words};
use crate::prbvh::search::search;
use crate::prbvh::worst::top::{TopNode, TopParams};
use crate::prbvh::worst::{self, RoundParams};
use crate::prbvh::{Move, PrbvhParams, group, paths, reinsert::reinsert};
use crate::presplit::pieces::{PiecesParams, pieces};
use crate::presplit::places::{self as presplit, ChunkShare, SumsParams};
use crate::presplit::priority::{PrioritiesParams, priorities};
use crate::ray::{Hit, Ray};
use crate::refit::{RefitParams, refit};
use crate::rotations::{self, RotateParams};
use crate::setup::{self, BoundsParams, BoxesParams, Triangle};
use crate::sort::{self, GatherParams, SortParams};
use crate::subtrees::{self, SubtreesParams};
use crate::trace::counts::{self, CountParams, RayCounts};
use crate::trace::path::{
    self, CameraParams, FilmParams, GatherParams as LightParams, Light, Path, Pixel, ShadeParams, Surface,
};
use crate::trace::stack::LocalStack;
use crate::trace::wide::{Bvh4Node, Bvh8Node, CwbvhNode, trace_wide};
use crate::trace::{self as tracing, TraceNode, TraceParams, TraceTriangle, trace};
#[cfg(target_arch = "spirv")]
use spirv_std::{glam::UVec3, spirv};

kernels! {
    SetupBoxes setup_boxes(params: BoxesParams) [
        0 triangles: &[Triangle], 1 boxes: &[Slot<Aabb>],
    ] => |i| setup::boxes(i, triangles, boxes);

    SetupBounds setup_bounds(params: BoundsParams) [
        0 boxes: &[Aabb], 1 united: &[Slot<Aabb>],
    ] shared words: setup::BOUNDS_WORDS => |w| setup::bounds(w, params, boxes, united, words);

    PresplitPriorities presplit_priorities(params: PrioritiesParams) [
        0 triangles: &[Triangle], 1 priority: &[Slot<f32>],
    ] => |i| priorities(i, params, triangles, priority);

    PresplitSums presplit_sums(params: SumsParams) [
        0 priority: &[f32], 1 scales: &[f32], 2 sums: &[Slot<u32>],
    ] shared words: presplit::SUMS_WORDS => |w| presplit::sums(w, params, priority, scales, sums, words);

    PresplitPlaces presplit_places(params: presplit::PlacesParams) [
        0 priority: &[f32], 1 shares: &[ChunkShare], 2 splits: &[Slot<u32>], 3 places: &[Slot<u32>],
    ] shared words: presplit::PLACES_WORDS => |w| presplit::places(w, params, priority, shares, splits, places, words);

    PresplitPieces presplit_pieces(params: PiecesParams) [
        0 triangles: &[Triangle], 1 splits: &[u32], 2 places: &[u32], 3 boxes: &[Slot<Aabb>], 4 owners: &[Slot<u32>],
    ] => |i| pieces(i, params, triangles, splits, places, boxes, owners);

    Morton30 morton_30(params: MortonParams) [
        0 boxes: &[Aabb], 1 codes: &[Slot<u32>], 2 order: &[Slot<u32>],
    ] => |i| morton::code_30(i, params, boxes, codes, order);

    Morton60 morton_60(params: MortonParams) [
        0 boxes: &[Aabb], 1 high: &[Slot<u32>], 2 low: &[Slot<u32>], 3 order: &[Slot<u32>],
    ] => |i| morton::code_60(i, params, boxes, high, low, order);

    SortCount sort_count(params: SortParams) [
        0 keys: &[u32], 1 table: &[Slot<u32>],
    ] shared words: sort::COUNT_WORDS => |w| sort::count(w, params, keys, table, words);

    SortRows sort_rows(params: SortParams) [
        0 table: &[Slot<u32>], 1 totals: &[Slot<u32>],
    ] shared words: sort::ROWS_WORDS => |w| sort::rows(w, params, table, totals, words);

    SortScatter sort_scatter(params: SortParams) [
        0 keys: &[u32], 1 values: &[u32], 2 table: &[u32], 3 totals: &[u32], 4 sorted_keys: &[Slot<u32>],
        5 sorted_values: &[Slot<u32>],
    ] shared words: sort::SCATTER_WORDS => |w| {
        sort::scatter(w, params, keys, values, table, totals, sorted_keys, sorted_values, words);
    };

    SortScatterAlone sort_scatter_alone(params: SortParams) [
        0 keys: &[u32], 1 values: &[u32], 2 table: &[u32], 3 totals: &[u32], 4 sorted_keys: &[Slot<u32>],
        5 sorted_values: &[Slot<u32>],
    ] => |i| sort::scatter_alone(i, params, keys, values, table, totals, sorted_keys, sorted_values);

    SortGather sort_gather(params: GatherParams) [
        0 order: &[u32], 1 words: &[u32], 2 gathered: &[Slot<u32>],
    ] => |i| sort::gather(i, order, words, gathered);

    LbvhLeaves lbvh_leaves(params: LeavesParams) [
        0 order: &[u32], 1 boxes: &[Aabb], 2 nodes: &[AtomicNode],
    ] => |i| lbvh::leaves(i, params, order, boxes, nodes);

    LbvhHierarchy lbvh_hierarchy(params: HierarchyParams) [
        0 high: &[u32], 1 low: &[u32], 2 nodes: &[AtomicNode],
    ] => |i| lbvh::hierarchy(i, params, high, low, nodes);

    PlocClusters ploc_clusters(params: ClustersParams) [
        0 order: &[u32], 1 boxes: &[Aabb], 2 clusters: &[Slot<Cluster>], 3 progress: &[Slot<Progress>],
    ] => |i| ploc::clusters(i, params, order, boxes, clusters, progress);

    PlocNearest ploc_nearest(params: NearestParams) [
        0 clusters: &[Cluster], 1 progress: &[Progress], 2 neighbours: &[Slot<u32>],
    ] => |i| nearest(i, params, clusters, progress, neighbours);

    PlocMark ploc_mark(params: MergeParams) [
        0 neighbours: &[u32], 1 progress: &[Progress], 2 marks: &[Slot<u32>], 3 gone: &[Slot<u32>],
    ] shared words: merge::MARK_WORDS => |w| merge::mark(w, params, neighbours, progress, marks, gone, words);

    PlocMerge ploc_merge(params: MergeParams) [
        0 neighbours: &[u32], 1 marks: &[u32], 2 gone: &[u32], 3 clusters: &[Cluster], 4 progress: &[Progress],
        5 nodes: &[AtomicNode], 6 next_clusters: &[Slot<Cluster>], 7 next_progress: &[Slot<Progress>],
    ] shared words: merge::MERGE_WORDS => |w| {
        merge::merge(
            w, params, neighbours, marks, gone, clusters, progress, nodes, next_clusters, next_progress, words,
        );
    };

    #[cfg(feature = "atrbvh")]
    AtrbvhLevels atrbvh_levels(params: LevelsParams) [
        0 nodes: &[Node], 1 sizes: &[AtomicU32], 2 levels: &[AtomicU32], 3 order: &[Slot<u32>], 4 counts: &[AtomicU32],
        5 arrivals: &[AtomicU32],
    ] => |i| atrbvh::levels(i, params, nodes, sizes, levels, order, counts, arrivals);

    #[cfg(feature = "atrbvh")]
    AtrbvhRestructure atrbvh_restructure(params: RestructureParams) [
        0 order: &[u32], 1 nodes: &[AtomicNode], 2 report: &[AtomicU32],
    ] => |i| atrbvh::restructure(i, params, order, nodes, report);

    #[cfg(feature = "atrbvh")]
    TrbvhRestructure trbvh_restructure(params: RestructureParams) [
        0 order: &[u32], 1 nodes: &[AtomicNode], 2 report: &[AtomicU32],
    ] => |i| atrbvh::restructure_optimally(i, params, order, nodes, report);

    HplocStage hploc_stage(params: HplocParams) [
        0 radix: &[Node], 1 nodes: &[AtomicNode], 2 clusters: &[AtomicU32], 3 spare: &[AtomicU32],
        4 sizes: &[AtomicU32], 5 arrivals: &[AtomicU32], 6 places: &[Slot<u32>], 7 waiting: &[AtomicU32],
    ] => |i| hploc::stage(i, params, radix, nodes, clusters, spare, sizes, arrivals, places, waiting);

    KmeansCentres kmeans_centres(params: CentresParams) [
        0 parts: &[Part], 1 order: &[u32], 2 boxes: &[Aabb], 3 frames: &[Slot<Frame>], 4 centres: &[Slot<Point>],
        5 tallies: &[AtomicU32],
    ] => |i| kmeans::centres(i, params, parts, order, boxes, frames, centres, tallies);

    KmeansAssign kmeans_assign(params: AssignParams) [
        0 order: &[u32], 1 boxes: &[Aabb], 2 starts: &[u32], 3 sizes: &[u32], 4 frames: &[Frame], 5 centres: &[Point],
        6 labels: &[Slot<u32>], 7 tallies: &[AtomicU32],
    ] shared words: kmeans::ASSIGN_WORDS => |w| {
        kmeans::assign(w, params, order, boxes, starts, sizes, frames, centres, labels, tallies, words);
    };

    KmeansMeans kmeans_means(params: MeansParams) [
        0 parts: &[Part], 1 tallies: &[AtomicU32], 2 centres: &[Slot<Point>],
    ] => |i| kmeans::means(i, params, parts, tallies, centres);

    KmeansTally kmeans_tally(params: TallyParams) [
        0 order: &[u32], 1 boxes: &[Aabb], 2 starts: &[u32], 3 labels: &[u32], 4 tallies: &[AtomicU32],
    ] => |i| kmeans::tally(i, order, boxes, starts, labels, tallies);

    KmeansJoin kmeans_join(params: JoinParams) [
        0 parts: &[Part], 1 tallies: &[Slot<u32>], 2 targets: &[Slot<u32>], 3 sizes: &[Slot<u32>],
        4 nodes: &[AtomicNode], 5 next: &[Slot<Part>], 6 small: &[Slot<u32>], 7 progress: &[AtomicU32],
    ] shared words: kmeans::JOIN_WORDS => |w| {
        kmeans::join(w, params, parts, tallies, targets, sizes, nodes, next, small, progress, words);
    };

    KmeansRelabel kmeans_relabel(params: RelabelParams) [
        0 labels: &[u32], 1 targets: &[u32], 2 sizes: &[u32], 3 starts: &[Slot<u32>],
    ] => |i| kmeans::relabel(i, labels, targets, sizes, starts);

    KmeansHalve kmeans_halve(params: HalveParams) [
        0 small: &[u32], 1 starts: &[u32], 2 boxes: &[Aabb], 3 order: &[Slot<u32>], 4 sizes: &[Slot<u32>],
        5 cursors: &[Slot<u32>], 6 nodes: &[AtomicNode], 7 waiting: &[AtomicU32],
    ] => |i| kmeans::halve(i, params, small, starts, boxes, order, sizes, cursors, nodes, waiting);

    Rotations rotations_climb(params: RotateParams) [
        0 nodes: &[AtomicNode], 1 arrivals: &[AtomicU32], 2 kept: &[AtomicKept], 3 report: &[AtomicU32],
    ] => |i| rotations::rotate(i, params, nodes, arrivals, kept, report);

    Refit refit_climb(params: RefitParams) [
        0 nodes: &[AtomicNode], 1 arrivals: &[AtomicU32],
    ] => |i| refit(i, params, nodes, arrivals);

    SubtreesRefit subtrees_refit(params: SubtreesParams) [
        0 boxes: &[Aabb], 1 nodes: &[AtomicNode], 2 report: &[AtomicU32],
    ] => |i| subtrees::refit(i, params, boxes, nodes, report);

    Cost cost_sums(params: CostParams) [
        0 nodes: &[Node], 1 arrivals: &[u32], 2 partial: &[Slot<f32>], 3 report: &[AtomicU32],
    ] shared words: cost::COST_WORDS => |w| cost::cost(w, params, nodes, arrivals, partial, report, words);

    PrbvhSearch prbvh_search(params: PrbvhParams) [
        0 nodes: &[WideNode], 1 found: &[Slot<Move>], 2 books: &[AtomicU32], 3 report: &[AtomicU32],
    ] => |i| search(i, params, nodes, found, books, report);

    PrbvhLock prbvh_lock(params: PrbvhParams) [
        0 nodes: &[Node], 1 found: &[Slot<Move>], 2 locks: &[AtomicU64],
    ] => |i| lock(i, params, nodes, found, locks);

    PrbvhLockWords prbvh_lock_words(params: PrbvhParams) [
        0 nodes: &[Node], 1 found: &[Slot<Move>], 2 decreases: &[AtomicU32], 3 claims: &[AtomicU32],
    ] => |i| lock_words(i, params, nodes, found, decreases, claims);

    PrbvhCheck prbvh_check(params: PrbvhParams) [
        0 nodes: &[Node], 1 locks: &[AtomicU64], 2 found: &[Slot<Move>], 3 report: &[AtomicU32],
    ] => |i| check(i, params, nodes, locks, found, report);

    PrbvhCheckWords prbvh_check_words(params: PrbvhParams) [
        0 nodes: &[Node], 1 decreases: &[AtomicU32], 2 claims: &[AtomicU32], 3 found: &[Slot<Move>],
        4 report: &[AtomicU32],
    ] => |i| check_words(i, params, nodes, decreases, claims, found, report);

    PrbvhReinsert prbvh_reinsert(params: PrbvhParams) [
        0 found: &[Slot<Move>], 1 nodes: &[AtomicNode], 2 kept: &[Slot<Kept>], 3 books: &[AtomicU32],
        4 report: &[AtomicU32],
    ] => |i| reinsert(i, params, found, nodes, kept, books, report);

    PrbvhMark prbvh_mark(params: PrbvhParams) [
        0 found: &[Slot<Move>], 1 nodes: &[Node], 2 ways: &[AtomicU32], 3 report: &[AtomicU32],
    ] => |i| paths::mark(i, params, found, nodes, ways, report);

    PrbvhRefit prbvh_refit(params: PrbvhParams) [
        0 found: &[Slot<Move>], 1 nodes: &[AtomicNode], 2 ways: &[AtomicU32], 3 report: &[AtomicU32],
    ] => |i| paths::refit(i, params, found, nodes, ways, report, |_v, _area, _left, _right| {});

    DualSearch dual_search(params: DualParams) [
        0 nodes: &[WideNode], 1 list: &[u32], 2 found: &[Slot<Move>], 3 keys: &[AtomicU32], 4 books: &[AtomicU32],
        5 report: &[AtomicU32],
    ] => |i| worst::search(i, params, nodes, list, found, keys, books, report);

    WorstBooks worst_books(params: RoundParams) [
        0 books: &[AtomicU32], 1 fringe: &[AtomicU32], 2 report: &[AtomicU32],
    ] => |_i| worst::books::books(params, books, fringe, report);

    WorstCount worst_count(params: RoundParams) [
        0 pool: &[u32], 1 keys: &[u32], 2 books: &[AtomicU32],
    ] => |i| worst::select::count(i, params, pool, keys, books);

    WorstSelect worst_select(params: RoundParams) [
        0 nodes: &[WideNode], 1 keys: &[AtomicU32], 2 pool: &[AtomicU32], 3 list: &[Slot<u32>],
        4 fringe: &[AtomicU32], 5 books: &[AtomicU32],
    ] => |i| worst::select::select(i, params, nodes, keys, pool, list, fringe, books);

    WorstHead worst_head(params: RoundParams) [
        0 nodes: &[WideNode], 1 keys: &[AtomicU32], 2 fringe: &[AtomicU32], 3 pool: &[AtomicU32],
        4 list: &[Slot<u32>], 5 books: &[AtomicU32], 6 report: &[AtomicU32],
    ] shared words: group::HEAD_WORDS => |w| {
        group::head(w, params, nodes, keys, fringe, pool, list, books, report, words);
    };

    WorstTail worst_tail(params: RoundParams) [
        0 found: &[Slot<Move>], 1 nodes: &[AtomicNode], 2 locks: &[AtomicU64], 3 kept: &[Slot<Kept>],
        4 ways: &[AtomicU32], 5 keys: &[AtomicU32], 6 fringe: &[AtomicU32], 7 pool: &[AtomicU32],
        8 books: &[AtomicU32], 9 report: &[AtomicU32],
    ] shared words: group::TAIL_WORDS => |w| {
        group::tail(w, params, found, nodes, locks, kept, ways, keys, fringe, pool, books, report, words);
    };

    WorstTop worst_top(params: TopParams) [
        0 nodes: &[Node], 1 list: &[u32], 2 books: &[AtomicU32], 3 top: &[Slot<TopNode>],
    ] => |i| worst::top::top(i, params, nodes, list, books, top);

    WorstMark worst_mark(params: PrbvhParams) [
        0 found: &[Slot<Move>], 1 nodes: &[Node], 2 ways: &[AtomicU32], 3 keys: &[AtomicU32],
        4 fringe: &[AtomicU32], 5 books: &[AtomicU32], 6 report: &[AtomicU32],
    ] => |i| worst::refit::mark(i, params, found, nodes, ways, keys, fringe, books, report);

    WorstRefit worst_refit(params: PrbvhParams) [
        0 found: &[Slot<Move>], 1 nodes: &[AtomicNode], 2 ways: &[AtomicU32], 3 keys: &[AtomicU32],
        4 pool: &[AtomicU32], 5 books: &[AtomicU32], 6 report: &[AtomicU32],
    ] => |i| worst::refit::refit(i, params, found, nodes, ways, keys, pool, books, report);

    KeptRestore kept_restore(params: RestoreParams) [
        0 kept: &[Kept], 1 nodes: &[AtomicNode],
    ] => |i| kept::restore(i, params, kept, nodes);

    KeptGraft kept_graft(params: KeptGraftParams) [
        0 grafts: &[Graft], 1 nodes: &[AtomicNode],
    ] => |i| kept::graft(i, grafts, nodes);

    CollapseSizes collapse_sizes(params: CollapseParams) [
        0 nodes: &[Node], 1 subtrees: &[AtomicU32], 2 arrivals: &[AtomicU32],
    ] => |i| collapse::sizes(i, params, nodes, subtrees, arrivals);

    CollapsePlaces collapse_places(params: PlacesParams) [
        0 nodes: &[Node], 1 subtrees: &[u32], 2 places: &[Slot<Place>],
    ] => |i| collapse::places(i, nodes, subtrees, places);

    CollapseJump collapse_jump(params: PlacesParams) [
        0 places: &[Place],
        1 longer: &[Slot<Place>],
    ] => |i| collapse::jump(i, places, longer);

    CollapseEmit collapse_emit(params: EmitParams) [
        0 nodes: &[Node], 1 subtrees: &[u32], 2 places: &[Place], 3 compact: &[Slot<CompactNode>],
        4 order: &[Slot<u32>],
    ] => |i| collapse::emit(i, params, nodes, subtrees, places, compact, order);

    CollapseWiden collapse_widen(params: WidenParams) [
        0 nodes: &[Node], 1 forests: &[AtomicU32], 2 choices: &[Slot<u32>], 3 arrivals: &[AtomicU32],
    ] => |i| widen(i, params, nodes, forests, choices, arrivals);

    Trace32 trace_32(params: TraceParams) [
        0 nodes: &[TraceNode], 1 triangles: &[TraceTriangle], 2 rays: &[Ray], 3 hits: &[Slot<Hit>],
    ] => |i| trace(i, params, nodes, triangles, rays, hits, &mut LocalStack::<32>::new());

    Trace64 trace_64(params: TraceParams) [
        0 nodes: &[TraceNode], 1 triangles: &[TraceTriangle], 2 rays: &[Ray], 3 hits: &[Slot<Hit>],
    ] => |i| trace(i, params, nodes, triangles, rays, hits, &mut LocalStack::<64>::new());

    Trace128 trace_128(params: TraceParams) [
        0 nodes: &[TraceNode], 1 triangles: &[TraceTriangle], 2 rays: &[Ray], 3 hits: &[Slot<Hit>],
    ] => |i| trace(i, params, nodes, triangles, rays, hits, &mut LocalStack::<128>::new());

    TraceDeep trace_deep(params: TraceParams) [
        0 nodes: &[TraceNode],
        1 triangles: &[TraceTriangle], 2 rays: &[Ray], 3 hits: &[Slot<Hit>], 4 words: &[Slot<u32>],
    ] => |i| tracing::trace_deep(i, params, nodes, triangles, rays, hits, words);

    TraceBvh4 trace_bvh4(params: TraceParams) [
        0 nodes: &[Bvh4Node],
        1 triangles: &[TraceTriangle], 2 rays: &[Ray], 3 hits: &[Slot<Hit>],
    ] => |i| trace_wide(i, params, nodes, triangles, rays, hits);

    TraceBvh4Deep trace_bvh4_deep(params: TraceParams) [
        0 nodes: &[Bvh4Node],
        1 triangles: &[TraceTriangle], 2 rays: &[Ray], 3 hits: &[Slot<Hit>], 4 words: &[Slot<u32>],
    ] => |i| tracing::trace_deep(i, params, nodes, triangles, rays, hits, words);

    TraceBvh8 trace_bvh8(params: TraceParams) [
        0 nodes: &[Bvh8Node],
        1 triangles: &[TraceTriangle], 2 rays: &[Ray], 3 hits: &[Slot<Hit>],
    ] => |i| trace_wide(i, params, nodes, triangles, rays, hits);

    TraceBvh8Deep trace_bvh8_deep(params: TraceParams) [
        0 nodes: &[Bvh8Node],
        1 triangles: &[TraceTriangle], 2 rays: &[Ray], 3 hits: &[Slot<Hit>], 4 words: &[Slot<u32>],
    ] => |i| tracing::trace_deep(i, params, nodes, triangles, rays, hits, words);

    TraceCwbvh trace_cwbvh(params: TraceParams) [
        0 nodes: &[CwbvhNode],
        1 triangles: &[TraceTriangle], 2 rays: &[Ray], 3 hits: &[Slot<Hit>],
    ] => |i| trace_wide(i, params, nodes, triangles, rays, hits);

    TraceCwbvhDeep trace_cwbvh_deep(params: TraceParams) [
        0 nodes: &[CwbvhNode],
        1 triangles: &[TraceTriangle], 2 rays: &[Ray], 3 hits: &[Slot<Hit>], 4 words: &[Slot<u32>],
    ] => |i| tracing::trace_deep(i, params, nodes, triangles, rays, hits, words);

    CountRays trace_count(params: CountParams) [
        0 rays: &[Ray], 1 hits: &[Hit],
        2 counts: &[Slot<RayCounts>],
    ] => |i| counts::count_rays(i, params, rays, hits, counts);

    PathCamera path_camera(params: CameraParams) [
        0 rays: &[Slot<Ray>],
        1 paths: &[Slot<Path>],
    ] => |i| path::camera(i, params, rays, paths);

    PathShade path_shade(params: ShadeParams) [
        0 hits: &[Hit], 1 surfaces: &[Surface], 2 rays: &[Slot<Ray>], 3 paths: &[Slot<Path>],
        4 shadow_rays: &[Slot<Ray>], 5 lights: &[Slot<Light>],
    ] => |i| path::shade(i, params, hits, surfaces, rays, paths, shadow_rays, lights);

    PathGather path_gather(params: LightParams) [
        0 shadow_hits: &[Hit],
        1 lights: &[Light],
        2 paths: &[Slot<Path>],
    ] => |i| path::gather(i, params, shadow_hits, lights, paths);

    PathFilm path_film(params: FilmParams) [
        0 paths: &[Path],
        1 pixels: &[Slot<Pixel>],
    ] => |i| path::film(i, paths, pixels);
}

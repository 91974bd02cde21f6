//! What a row of the table in [`crate::entries`] becomes.

/// Makes the SPIR-V entry point, the description and the native entry of each row. The names that it uses are those at the place of its call.
macro_rules! kernels {
    ($(
        $(#[$cfg:meta])*
        $variant:ident $name:ident($params:ident: $params_type:ty) [
            $($binding:tt $buffer:ident: $view:ty),+ $(,)?
        ] $(shared $shared:ident: $words:expr)? => |$i:ident| $body:expr;
    )+) => {
        $(
            crate::entry::spirv_entry! {
                $(#[$cfg])*
                #[doc = concat!("SPIR-V entry point of [`Kernel::", stringify!($variant), "`].")]
                $name($params: $params_type) [$($binding $buffer: $view),+] ($($shared: $words)?) |$i| $body
            }
        )+

        /// A kernel; see the rows of this table for what each takes.
        #[cfg(not(target_arch = "spirv"))]
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum Kernel {
            $(
                $(#[$cfg])*
                #[doc = concat!("`", stringify!($name), "`")]
                $variant,
            )+
        }

        #[cfg(not(target_arch = "spirv"))]
        impl Kernel {
            /// Every kernel.
            pub const ALL: &'static [Self] = &[$($(#[$cfg])* Self::$variant),+];

            /// Name, push constants and buffers.
            #[must_use]
            pub const fn info(self) -> &'static crate::KernelInfo {
                use crate::native::{BindingInfo, KernelInfo, View};
                match self {
                    $(
                        $(#[$cfg])*
                        Self::$variant => &KernelInfo {
                            name: stringify!($name),
                            push_bytes: size_of::<$params_type>(),
                            bindings: &[$(BindingInfo {
                                name: stringify!($buffer),
                                access: <$view as View<'static>>::ACCESS,
                                element_bytes: <$view as View<'static>>::ELEMENT_BYTES,
                            }),+],
                            shared_bytes: 0 $(+ 4 * $words)?,
                        },
                    )+
                }
            }

            /// Its SPIR-V module, little-endian.
            #[cfg(feature = "spirv")]
            #[must_use]
            pub const fn spirv(self) -> &'static [u8] {
                match self {
                    $(
                        $(#[$cfg])*
                        Self::$variant => {
                            include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/spv/", stringify!($name), ".spv"))
                        }
                    )+
                }
            }

            /// Invocations that take about as long as to hand them to another thread.
            fn grain(self) -> u32 {
                match self {
                    // Searches.
                    Self::DualSearch => 8,
                    Self::PrbvhSearch | Self::PlocNearest => 16,
                    #[cfg(feature = "atrbvh")]
                    Self::AtrbvhRestructure | Self::TrbvhRestructure => 1,
                    Self::KmeansCentres | Self::KmeansAssign | Self::KmeansJoin => 1,
                    Self::KmeansHalve => 4,
                    Self::SubtreesRefit => 2,
                    // Chunks.
                    Self::WorstCount | Self::WorstSelect | Self::SortScatterAlone => 16,
                    // Workgroups.
                    Self::SetupBounds => 2,
                    Self::Cost | Self::SortCount | Self::SortScatter | Self::PlocMark | Self::PlocMerge => 4,
                    Self::SortRows => 64,
                    // Walks and climbs.
                    Self::HplocStage | Self::Rotations | Self::Refit | Self::PrbvhRefit | Self::PrbvhMark | Self::WorstRefit | Self::WorstMark => 32,
                    Self::Trace32 | Self::Trace64 | Self::Trace128 | Self::TraceDeep => 16,
                    Self::TraceBvh4 | Self::TraceBvh4Deep | Self::TraceBvh8 | Self::TraceBvh8Deep => 16,
                    Self::TraceCwbvh | Self::TraceCwbvhDeep => 16,
                    _ => 256,
                }
            }

            /// Runs the entry natively for each of `count` invocations, or for the workgroups that hold them, in the order of the dispatcher.
            ///
            /// # Panics
            /// If `push` or `buffers` are not what [`Kernel::info`] says, or if an invocation goes out of bounds.
            pub fn run(
                self,
                dispatcher: &impl crate::native::Dispatcher,
                count: u32,
                push: &[u8],
                buffers: Vec<crate::native::Bytes<'_>>,
            ) {
                use crate::native::View;
                let info = self.info();
                assert_eq!(buffers.len(), info.bindings.len(), "buffers of {}", info.name);
                let mut buffers = buffers.into_iter();
                let mut next = move || buffers.next().expect("as many buffers as bindings");
                match self {
                    $(
                        $(#[$cfg])*
                        Self::$variant => {
                            let $params: &$params_type = &bytemuck::pod_read_unaligned(push);
                            $(let $buffer = <$view as View<'_>>::bind(next());)+
                            crate::entry::native_entry! {
                                dispatcher, count, self.grain();
                                $name($params) [$($buffer),+] ($($shared: $words)?) |$i| $body
                            }
                        }
                    )+
                }
            }
        }
    };
}

/// The SPIR-V entry point of a row. Without shared memory the body is that of one invocation, with it that of a workgroup.
macro_rules! spirv_entry {
    (
        $(#[$attribute:meta])*
        $name:ident($params:ident: $params_type:ty) [$($binding:tt $buffer:ident: $view:ty),+] () |$i:ident| $body:expr
    ) => {
        $(#[$attribute])*
        #[cfg(target_arch = "spirv")]
        #[spirv(compute(threads(64)))]
        #[inline(always)]
        #[allow(clippy::too_many_arguments, reason = "an entry has a parameter for each buffer")]
        pub fn $name(
            #[spirv(global_invocation_id)] id: UVec3,
            #[spirv(num_workgroups)] workgroups: UVec3,
            #[spirv(push_constant)] $params: &$params_type,
            $(#[spirv(storage_buffer, descriptor_set = 0, binding = $binding)] $buffer: $view),+
        ) {
            let $i = grid::linear_id(id, workgroups);
            if $i < $params.count {
                $body;
            }
        }
    };
    (
        $(#[$attribute:meta])*
        $name:ident($params:ident: $params_type:ty) [$($binding:tt $buffer:ident: $view:ty),+]
        ($shared:ident: $words:expr) |$w:ident| $body:expr
    ) => {
        $(#[$attribute])*
        #[cfg(target_arch = "spirv")]
        #[spirv(compute(threads(64)))]
        #[allow(clippy::too_many_arguments, reason = "an entry has a parameter for each buffer")]
        pub fn $name(
            #[spirv(workgroup_id)] id: UVec3,
            #[spirv(num_workgroups)] workgroups: UVec3,
            #[spirv(local_invocation_index)] lane: u32,
            #[spirv(push_constant)] $params: &$params_type,
            $(#[spirv(storage_buffer, descriptor_set = 0, binding = $binding)] $buffer: $view,)+
            #[spirv(workgroup)] $shared: &mut [crate::mem::SharedU32; $words],
        ) {
            let group = grid::linear_group(id, workgroups);
            // The same for the whole group: all come to each barrier, or none.
            if group < $params.count.div_ceil(grid::WORKGROUP_SIZE) {
                let $w = &crate::workgroup::OnDevice { group, lane };
                let $shared = &*$shared;
                $body;
            }
        }
    };
}

/// Runs a row natively.
#[cfg(not(target_arch = "spirv"))]
macro_rules! native_entry {
    ($dispatcher:expr, $count:expr, $grain:expr; $name:ident($params:ident) [$($buffer:ident),+] () |$i:ident| $body:expr) => {
        $dispatcher.for_each($count, $grain, |i| {
            let $i = i;
            if $i < $params.count {
                $body;
            }
        });
    };
    (
        $dispatcher:expr, $count:expr, $grain:expr;
        $name:ident($params:ident) [$($buffer:ident),+] ($shared:ident: $words:expr) |$w:ident| $body:expr
    ) => {
        let groups = crate::math::umin($count, $params.count).div_ceil($crate::grid::WORKGROUP_SIZE);
        if $dispatcher.is_alone() {
            $dispatcher.for_each(groups, $grain, |group| {
                let $w = &crate::native::Alone { group };
                let $shared = &$w.memory::<{ $words }>();
                $body;
            });
        } else {
            $dispatcher.for_each(groups, $grain, |group| {
                let $w = &crate::native::Lanes::new($dispatcher, group);
                let $shared = &$w.memory::<{ $words }>();
                $body;
            });
        }
    };
}

pub(crate) use kernels;
#[cfg(not(target_arch = "spirv"))]
pub(crate) use native_entry;
pub(crate) use spirv_entry;

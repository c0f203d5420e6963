"""Functions of the packages of kernels that are in no list of kernels, and why not.

`test_kernel_promises.py` asks that every other one is: a new kernel cannot be forgotten.
"""

PACKAGES = (
    "asmjax.numerics", "asmjax.footprint", "asmjax.geometry", "asmjax.buffers", "asmjax.theory",
    "asmjax.metrics", "asmjax.shadow.comparison", "asmjax.shadow.neighbourhood",
    "asmjax.shadow.soft", "asmjax.shadow.filtered", "asmjax.shadow.warped.predicted",
    "asmjax.shadow.warped.sight", "asmjax.shadow.warped.table", "asmjax.shadow.adaptive.address",
    "asmjax.shadow.adaptive.page_table", "asmjax.shadow.adaptive.tree",
)  # fmt: skip
"""Modules, and packages with all of theirs, whose functions are kernels unless said otherwise."""

HOST = "NumPy on the host, once a frame or less: nothing is traced"
WHOLE = "bool, integers or tables of them"
PART = "a part of kernels of the lists, which go through it"

EXEMPT = {
    HOST: (
        "asmjax.geometry.area_light: stratified concentric disk_light",
        "asmjax.geometry.basis: unit basis_from_axis bases_along",
        "asmjax.geometry.camera: look_at",
        "asmjax.geometry.charts: padded plane_to_image image_to_plane",
        "asmjax.geometry.light_frame: towards_light in_domain cosine_of fixed_frame "
        "fitted_point_frame fitted_directional_frame",
        "asmjax.geometry.reintersect: meet_triangles_on_host",
        "asmjax.buffers.points: eye_buffer seen_points",
        "asmjax.buffers.rays: whole_image",
        "asmjax.shadow.comparison: check_test texel_bytes stored",
        "asmjax.shadow.soft.nearest: sides",
        "asmjax.shadow.soft.sampled_light: sample_frames",
        "asmjax.shadow.soft.wide_map: margins behind_emitter",
        "asmjax.shadow.warped.table: exact",
    ),
    "NumPy, of whole images: `test_metrics`": (
        "asmjax.metrics.boundary: surface_pairs boundary_edges edge_midpoints boundary_length "
        "distances boundary_displacement",
        "asmjax.metrics.soft_error: soft_error",
        "asmjax.metrics.summary: error_summary",
        "asmjax.metrics.visibility_error: signed_error visibility_error",
        "asmjax.metrics.windows: box_sum",
    ),
    WHOLE: (
        "asmjax.footprint.benefit: straddles_discontinuity cell_index cell_benefit",
        "asmjax.shadow.comparison: pack_prim plane_is_trusted",
        "asmjax.shadow.neighbourhood: beside is_own",
        "asmjax.shadow.soft.wide_map: tapped",
        "asmjax.shadow.filtered.pixels: pixel_of noise",
        "asmjax.shadow.warped.sight: bin_of",
        "asmjax.shadow.adaptive.page_table: level_of page_of find_entries take warm_tables",
        "asmjax.shadow.adaptive.tree: empty_tree with_room serve page_outcome lookup store_pages "
        "store_run",
    ),
    PART: (
        "asmjax.numerics: least_depth",
        "asmjax.footprint.beams: narrowest_pixel",
        "asmjax.footprint.mipmap: log2_footprint_axes",
        "asmjax.geometry.basis: axes_across",
        "asmjax.buffers.anchored: image_rows",
        "asmjax.buffers.receivers: of_face",
        "asmjax.theory.arguments: held floating setting depth_range warp_strength signed_strength "
        "half_angle half_angle_tangent resolutions parts beyond_near seen_depth ahead",
        "asmjax.theory.light_direction: best_strength",
        "asmjax.theory.limits: log1p_over expm1_over over_range",
        "asmjax.theory.parameterization: equation_4",
        "asmjax.theory.subdivision: uniform_splits logarithmic_splits blended_splits",
        "asmjax.shadow.soft.wide_map: of_face",
        "asmjax.shadow.adaptive.address: below_1 inverse_power",
    ),
    "no arithmetic: a number is told, or how long float64 is on": (
        "asmjax.numerics: scalar in_float64",
        "asmjax.shadow.soft.hamburger: alpha_of",
    ),
    "powers of one depth: `test_hamburger`": ("asmjax.shadow.soft.hamburger: moments_of",),
    "of painted texels in the same ways: `test_filtered`": (
        "asmjax.shadow.filtered.windows: box dithered",
    ),
    "of a whole view at once: `test_predicted`": (
        "asmjax.shadow.warped.predicted: slabs_of slab_alpha log2_errors log2_p_mean",
        "asmjax.shadow.warped.sight: outline_of in_bins plane_jacobian beam_jacobian plane_of "
        "turned parallel_sight",
    ),
}
"""Reason to functions: "module: names"."""


def exempt_names() -> list[str]:
    """Full names, "module.name"."""
    lines = [line.split(": ") for lines in EXEMPT.values() for line in lines]
    return [f"{module}.{name}" for module, names in lines for name in names.split()]

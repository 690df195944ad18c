// libascc for C++17, over ascc/ascc.h: handles that destroy themselves, errors as exceptions, arrays
// that know their size. SPDX-License-Identifier: MIT
//
// Said once, true of every call; the rest is as ascc.h says of the call of the same name:
//   results    are returned; a struct's `size` is set here.
//   errors     are thrown as ascc::error, which has the status and the handle's message; what was to
//              change is as it was. Nothing else throws but std::bad_alloc of the vectors returned.
//              Where exceptions are off, ascc.h is the interface.
//   arrays     rows that are given say how many there are. They are borrowed for the call and never read or
//              written beyond their end: rows of one call that differ in number are an ARGUMENT.
//   handles    model, particles and step are moved, not copied; context is shared by what is made of it. get()
//              is the C handle, for calls of ascc.h; it stays the object's.
//   callbacks  are C functions that no exception may leave (ascc_context_options).
#ifndef ASCC_ASCC_HPP
#define ASCC_ASCC_HPP

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "ascc.h"

namespace ascc
{

/// What a call of the library that failed throws.
class error : public std::runtime_error
{
  public:
    error(ascc_status status, const std::string &message)
        : std::runtime_error(message.empty() ? ascc_status_text(status)
                                             : ascc_status_text(status) + (": " + message)),
          status_(status)
    {
    }
    ascc_status status() const noexcept
    {
        return status_;
    }

  private:
    ascc_status status_;
};

/// A struct of ascc.h with its size set and all else at its default.
template <class Struct> Struct sized() noexcept
{
    Struct s{};
    s.size = sizeof s;
    return s;
}

// ---- Arrays of the host ------------------------------------------------------------------------

namespace detail
{

// What an element of a host's array holds: numbers of one type, `width` of them in a row; 0: one
// number, of which a row takes as many as it has components.
template <class T> struct element {
    static constexpr bool known = std::is_same_v<T, float> || std::is_same_v<T, double>;
    static constexpr std::size_t width = 0;
    using scalar = T;
};
template <class T, std::size_t N> struct element<T[N]> : element<T> {
    static constexpr std::size_t width = N;
};
template <class T, std::size_t N> struct element<std::array<T, N>> : element<T[N]> {
};

template <class Range> using pointer_of = decltype(std::declval<Range &>().data());
template <class Range> using element_of = std::remove_pointer_t<pointer_of<Range>>;

template <class Range, bool writes, class = void> struct is_range : std::false_type {
};
template <class Range, bool writes>
struct is_range<Range, writes,
                std::void_t<pointer_of<Range>, decltype(std::declval<Range &>().size())>>
    : std::bool_constant<element<std::remove_cv_t<element_of<Range>>>::known &&
                         !(writes && std::is_const_v<element_of<Range>>)> {
};

} // namespace detail

/**
 * Rows of float or double in the host's memory: rows<false> are read, rows<true> written; `input` and
 * `output` below. Made of
 *   a container of numbers (vector, array, std::span): packed rows, as many as fill it;
 *   a container of std::array<float, N> and the like: a row each, N at least the components wanted;
 *   member(container, &type::field): a member of each struct, float[N], std::array or one number;
 *   a pointer and how many numbers there are: packed rows;
 *   rows::strided: any other distance between rows and between components.
 */
template <bool writes> class rows
{
  public:
    using pointer = std::conditional_t<writes, void *, const void *>;
    using array = std::conditional_t<writes, ascc_array, ascc_const_array>;

    /// None: the default of what a call may go without.
    rows() = default;

    /// What is written can be read.
    template <bool other, class = std::enable_if_t<other && !writes>>
    rows(const rows<other> &from) noexcept
        : data_(from.data_), count_(from.count_), width_(from.width_), stride_(from.stride_),
          component_stride_(from.component_stride_), scalar_(from.scalar_), present_(from.present_)
    {
    }

    template <class Range, class = std::enable_if_t<
                               detail::is_range<std::remove_reference_t<Range>, writes>::value>>
    rows(Range &&range)
    {
        using element =
            detail::element<std::remove_cv_t<detail::element_of<std::remove_reference_t<Range>>>>;
        fill<typename element::scalar>(range.data(), range.size(), element::width,
                                       element::width * sizeof(typename element::scalar), 0);
    }

    template <class Scalar,
              class = std::enable_if_t<detail::element<std::remove_cv_t<Scalar>>::known &&
                                       detail::element<std::remove_cv_t<Scalar>>::width == 0 &&
                                       !(writes && std::is_const_v<Scalar>)>>
    rows(Scalar *data, std::size_t numbers)
    {
        fill<std::remove_cv_t<Scalar>>(data, numbers, 0, 0, 0);
    }

    /**
     * `count` rows of `width` numbers that begin `stride` bytes apart, their numbers component_stride bytes
     * (0: next to each other). A stride of 0 is refused: no row stands for all.
     */
    template <class Scalar>
    static rows strided(Scalar *data, std::size_t count, std::size_t width, std::ptrdiff_t stride,
                        std::ptrdiff_t component_stride = 0)
    {
        if (stride == 0 && count > 1)
            throw error(ASCC_ERROR_ARGUMENT, "a stride of 0 does not repeat one row for all");
        rows made;
        made.template fill<std::remove_cv_t<Scalar>>(data, count, width, stride, component_stride);
        return made;
    }

    bool absent() const noexcept
    {
        return !present_;
    }

    /// How many rows there are. Throws ARGUMENT where the numbers are not whole rows, or rows too short.
    std::size_t count(std::size_t components) const
    {
        if (width_ == 0 && components != 0 && count_ % components == 0)
            return count_ / components;
        if (width_ == 0 || width_ < components)
            throw error(ASCC_ERROR_ARGUMENT,
                        std::to_string(width_ ? width_ : count_) +
                            (width_ ? " numbers in a row, " : " numbers in rows of ") +
                            std::to_string(components) + (width_ ? " are wanted" : ""));
        return count_;
    }

    /// As the C functions take it.
    array raw() const noexcept
    {
        static double nowhere; // what an empty container points at: NULL would mean absent
        array a{};
        a.data = present_ && !data_ ? &nowhere : data_;
        a.stride = width_ ? stride_ : 0;
        a.component_stride = width_ ? component_stride_ : 0;
        a.scalar = scalar_;
        return a;
    }

  private:
    friend class rows<!writes>;
    template <class Scalar>
    void fill(pointer data, std::size_t count, std::size_t width, std::ptrdiff_t stride,
              std::ptrdiff_t component_stride)
    {
        static_assert(detail::element<Scalar>::known, "float or double");
        present_ = true;
        data_ = data;
        count_ = count;
        width_ = width;
        stride_ = stride;
        component_stride_ = component_stride;
        scalar_ = std::is_same_v<Scalar, double> ? ASCC_DOUBLE : ASCC_FLOAT;
    }

    pointer data_ = nullptr;
    std::size_t count_ = 0; // rows, or numbers where width_ is 0
    std::size_t width_ = 0; // numbers in a row; 0: as many as are wanted
    std::ptrdiff_t stride_ = 0, component_stride_ = 0;
    ascc_scalar scalar_ = ASCC_FLOAT;
    bool present_ = false;
};

using input = rows<false>;
using output = rows<true>;

/// The same member of each struct in a container: member(vertices, &vertex::position). What is read of may
/// be const.
template <class Range, class Struct, class Field> auto member(Range &range, Field Struct::*field)
{
    using element = detail::element<std::remove_cv_t<Field>>;
    using scalar = typename element::scalar;
    using one = detail::element_of<Range>;
    constexpr bool writes = !std::is_const_v<one> && !std::is_const_v<Field>;
    static_assert(element::known, "a member of float, double, or an array of these");
    static_assert(std::is_same_v<std::remove_cv_t<one>, Struct>, "a member of these structs");
    constexpr std::size_t width = element::width ? element::width : 1;
    using number = std::conditional_t<writes, scalar, const scalar>;
    number *first = nullptr;
    if (range.size() != 0) {
        std::conditional_t<writes, void *, const void *> at = &(range.data()->*field);
        first = static_cast<number *>(at);
    }
    return rows<writes>::strided(first, range.size(), width, sizeof(Struct));
}

// ---- Handles -----------------------------------------------------------------------------------

namespace detail
{

template <class Handle, void (*destroy)(Handle **)> struct destroyer {
    void operator()(Handle *handle) const noexcept
    {
        destroy(&handle);
    }
};
template <class Handle, void (*destroy)(Handle **)>
using owned = std::unique_ptr<Handle, destroyer<Handle, destroy>>;

} // namespace detail

/// Memory, log and threads. Copies are the same context, which lives until the last thing made of it is gone.
class context
{
  public:
    /// `threads` that a step may use at once, the caller's included.
    explicit context(std::int32_t threads = 1) : context(with_threads(threads))
    {
    }
    explicit context(const ascc_context_options &options)
    {
        ascc_context *made = nullptr;
        const ascc_status status = ascc_context_create(&options, &made);
        if (status != ASCC_OK)
            throw error(status, "context");
        handle_ = std::shared_ptr<ascc_context>(
            made, detail::destroyer<ascc_context, ascc_context_destroy>());
    }

    ascc_context *get() const noexcept
    {
        return handle_.get();
    }
    std::uint32_t cpu() const noexcept
    {
        return ascc_context_cpu(get());
    }
    std::string message() const
    {
        std::string text(ascc_context_message(get(), nullptr, 0) + 1, '\0');
        const std::size_t length = ascc_context_message(get(), text.data(), text.size());
        text.resize(length < text.size() ? length
                                         : text.size() - 1); // another thread's may be longer
        return text;
    }
    /// Throws what a call that leaves its message in the context has to say.
    void check(ascc_status status) const
    {
        if (status != ASCC_OK)
            throw error(status, message());
    }

  private:
    static ascc_context_options with_threads(std::int32_t threads) noexcept
    {
        auto options = sized<ascc_context_options>();
        options.thread_count = threads;
        return options;
    }
    std::shared_ptr<ascc_context> handle_;
};

/// Trained weights. Any number of steps on any threads may share one.
class model
{
  public:
    /// By its path or, in the folders of ascc_model_find, by its name.
    model(const context &owner, const std::string &name) : context_(owner)
    {
        char path[4096];
        ascc_model *made = nullptr;
        context_.check(ascc_model_find(context_.get(), name.c_str(), path, sizeof path));
        context_.check(ascc_model_load(context_.get(), path, &made));
        handle_.reset(made);
    }
    model(const context &owner, const void *data, std::size_t size) : context_(owner)
    {
        ascc_model *made = nullptr;
        context_.check(ascc_model_load_memory(context_.get(), data, size, &made));
        handle_.reset(made);
    }

    const ascc_model *get() const noexcept
    {
        return handle_.get();
    }
    void save(const std::string &path) const
    {
        context_.check(ascc_model_save(get(), path.c_str()));
    }
    /// The file's bytes; the model's, valid as long as it lives.
    std::pair<const void *, std::size_t> bytes() const noexcept
    {
        std::size_t size = 0;
        const void *data = ascc_model_bytes(get(), &size);
        return {data, size};
    }
    ascc_model_info info() const
    {
        auto info = sized<ascc_model_info>();
        context_.check(ascc_model_get_info(get(), &info));
        return info;
    }
    /// Of a particle set that suits it; length_unit as for the step.
    ascc_particles_options particles_options(double length_unit = 1.0) const
    {
        auto options = sized<ascc_particles_options>();
        context_.check(ascc_model_particles_options(get(), length_unit, &options));
        return options;
    }

  private:
    context context_;
    detail::owned<ascc_model, ascc_model_destroy> handle_;
};

/// Impulse in quanta, exact, and torque, as ascc_particles_body_impulse tells them.
struct body_impulse {
    std::array<std::int64_t, 3> impulse;
    std::array<double, 3> torque;
};

/// Fluid and walls at one instant. One thread at a time; reading is not changing.
class particles
{
  public:
    particles(const context &owner, const ascc_particles_options &options) : context_(owner)
    {
        ascc_particles *made = nullptr;
        context_.check(ascc_particles_create(context_.get(), &options, &made));
        handle_.reset(made);
    }
    /// An empty set that suits a model.
    particles(const context &owner, const model &suits, double length_unit = 1.0)
        : particles(owner, suits.particles_options(length_unit))
    {
    }

    ascc_particles *get() noexcept
    {
        return handle_.get();
    }
    const ascc_particles *get() const noexcept
    {
        return handle_.get();
    }
    std::size_t count(ascc_kind kind = ASCC_FLUID) const noexcept
    {
        return ascc_particles_count(get(), kind);
    }
    std::size_t capacity(ascc_kind kind = ASCC_FLUID) const noexcept
    {
        return ascc_particles_capacity(get(), kind);
    }
    std::size_t dimension() const noexcept
    {
        return static_cast<std::size_t>(ascc_particles_dimension(get()));
    }
    double momentum_quantum() const noexcept
    {
        return ascc_particles_momentum_quantum(get());
    }

    void reserve(std::size_t fluid, std::size_t boundary = 0)
    {
        check(ascc_particles_reserve(get(), fluid, boundary));
    }
    /// Returns the ids of the particles added.
    std::vector<std::uint64_t> add_fluid(const input &position, const input &velocity = {},
                                         const input &mass = {})
    {
        const std::size_t count = position.count(dimension());
        expect("velocity", velocity, dimension(), count);
        expect("mass", mass, 1, count);
        std::vector<std::uint64_t> ids(count);
        const auto x = position.raw(), v = velocity.raw(), m = mass.raw();
        check(ascc_particles_add_fluid(get(), count, &x, velocity.absent() ? nullptr : &v,
                                       mass.absent() ? nullptr : &m, ids.data()));
        return ids;
    }
    std::vector<std::uint64_t> add_boundary(const input &position, const input &normal,
                                            std::int32_t body = 0)
    {
        const std::size_t count = position.count(dimension());
        expect("normal", normal, dimension(), count);
        std::vector<std::uint64_t> ids(count);
        const auto x = position.raw(), n = normal.raw();
        check(ascc_particles_add_boundary(get(), count, &x, &n, body, ids.data()));
        return ids;
    }
    void remove(const std::vector<std::uint64_t> &ids)
    {
        remove(ids.data(), ids.size());
    }
    void remove(const std::uint64_t *ids, std::size_t count)
    {
        check(ascc_particles_remove(get(), count, ids));
    }
    void clear(ascc_kind kind)
    {
        check(ascc_particles_clear(get(), kind));
    }
    void resize_fluid(std::size_t count)
    {
        check(ascc_particles_resize_fluid(get(), count));
    }

    /// Sets a field of as many rows as are given, from `first` on.
    void set(ascc_kind kind, ascc_field field, const input &values, std::size_t first = 0)
    {
        const auto raw = values.raw();
        check(ascc_particles_set(get(), kind, field, first, values.count(components(field)), &raw));
    }
    /// Reads a field into as many rows as are given.
    void get(ascc_kind kind, ascc_field field, const output &values, std::size_t first = 0) const
    {
        const auto raw = values.raw();
        context_.check(
            ascc_particles_get(get(), kind, field, first, values.count(components(field)), &raw));
    }
    /// A field of all rows, packed: read<float>(ASCC_FLUID, ASCC_POSITION).
    template <class Scalar = float> std::vector<Scalar> read(ascc_kind kind, ascc_field field) const
    {
        std::vector<Scalar> values(count(kind) * components(field));
        get(kind, field, values);
        return values;
    }
    std::vector<std::uint64_t> ids(ascc_kind kind = ASCC_FLUID) const
    {
        std::vector<std::uint64_t> ids(count(kind));
        context_.check(ascc_particles_get_ids(get(), kind, 0, ids.size(), ids.data()));
        return ids;
    }
    /// Of each boundary row.
    std::vector<std::int32_t> bodies() const
    {
        std::vector<std::int32_t> bodies(count(ASCC_BOUNDARY));
        context_.check(ascc_particles_get_bodies(get(), 0, bodies.size(), bodies.data()));
        return bodies;
    }
    /// Kind and row of a particle; none: no particle has this id.
    std::optional<std::pair<ascc_kind, std::size_t>> find(std::uint64_t id) const noexcept
    {
        std::pair<ascc_kind, std::size_t> at{};
        if (ascc_particles_find(get(), id, &at.first, &at.second) != ASCC_OK)
            return std::nullopt;
        return at;
    }

    /// int64_t[count][dimension], quanta.
    std::vector<std::int64_t> momentum() const
    {
        std::vector<std::int64_t> quanta(count() * dimension());
        context_.check(ascc_particles_get_momentum(get(), 0, count(), quanta.data()));
        return quanta;
    }
    std::array<std::int64_t, 3> total_momentum() const
    {
        std::array<std::int64_t, 3> total{};
        context_.check(ascc_particles_total_momentum(get(), total.data()));
        return total;
    }

    /// Adds a body; returns its number. Shape and pose begin with their size: ascc::sized makes them.
    std::int32_t add_body(const ascc_shape &shape, const ascc_pose *pose = nullptr)
    {
        std::int32_t body = -1;
        check(ascc_body_add(get(), &shape, pose, &body));
        return body;
    }
    std::int32_t add_body(const ascc_shape &shape, const ascc_pose &pose)
    {
        return add_body(shape, &pose);
    }
    void move_body(std::int32_t body, const ascc_pose &pose)
    {
        check(ascc_body_move(get(), body, &pose));
    }
    void remove_body(std::int32_t body)
    {
        check(ascc_body_remove(get(), body));
    }
    ascc_body_info body(std::int32_t body) const
    {
        auto info = sized<ascc_body_info>();
        context_.check(ascc_body_get(get(), body, &info));
        return info;
    }
    /// Numbers of all bodies that have a frame.
    std::vector<std::int32_t> body_numbers() const
    {
        std::vector<std::int32_t> all(ascc_bodies_list(get(), 0, nullptr));
        ascc_bodies_list(get(), all.size(), all.data());
        return all;
    }
    /// What the last run gave to each of these bodies, with torques about their origins.
    std::vector<ascc::body_impulse> body_impulses(const std::vector<std::int32_t> &bodies) const
    {
        std::vector<std::array<std::int64_t, 3>> impulses(bodies.size());
        std::vector<std::array<double, 3>> torques(bodies.size());
        context_.check(ascc_bodies_impulse(get(), bodies.size(), bodies.data(),
                                           reinterpret_cast<std::int64_t(*)[3]>(impulses.data()),
                                           reinterpret_cast<double(*)[3]>(torques.data())));
        std::vector<ascc::body_impulse> all(bodies.size());
        for (std::size_t i = 0; i < all.size(); i++)
            all[i] = {impulses[i], torques[i]};
        return all;
    }
    /// Lets out what is due; returns the ids of what came.
    std::vector<std::uint64_t> run_tap(ascc_tap &tap, double seconds)
    {
        const std::size_t before = count();
        std::size_t came = 0;
        check(ascc_tap_run(get(), &tap, seconds, 0, nullptr, &came));
        std::vector<std::uint64_t> ids(came);
        check(ascc_particles_get_ids(get(), ASCC_FLUID, before, came, ids.data()));
        return ids;
    }
    /// Removes what a drain takes; returns the ids of what is gone.
    std::vector<std::uint64_t> run_drain(const ascc_drain &drain)
    {
        std::vector<std::uint64_t> ids(count() + 1);
        std::size_t gone = 0;
        check(ascc_drain_run(get(), &drain, ids.size(), ids.data(), &gone));
        ids.resize(gone);
        return ids;
    }
    ascc::body_impulse body_impulse(std::int32_t body = -1,
                                    const std::array<double, 3> &point = {}) const
    {
        ascc::body_impulse got{};
        context_.check(ascc_particles_body_impulse(get(), body, point.data(), got.impulse.data(),
                                                   got.torque.data()));
        return got;
    }

    /// 1 for each fluid particle that sleeps.
    std::vector<std::uint8_t> asleep() const
    {
        std::vector<std::uint8_t> flags(count());
        context_.check(ascc_particles_get_asleep(get(), 0, flags.size(), flags.data()));
        return flags;
    }
    void wake()
    {
        check(ascc_particles_wake(get()));
    }

    std::vector<unsigned char> snapshot() const
    {
        std::vector<unsigned char> bytes(ascc_particles_snapshot_size(get()));
        context_.check(ascc_particles_snapshot(get(), bytes.data(), bytes.size()));
        return bytes;
    }
    void restore(const std::vector<unsigned char> &bytes)
    {
        restore(bytes.data(), bytes.size());
    }
    void restore(const void *bytes, std::size_t size)
    {
        check(ascc_particles_restore(get(), bytes, size));
    }
    std::uint64_t hash() const noexcept
    {
        return ascc_particles_hash(get());
    }
    ascc_measures measure()
    {
        auto measures = sized<ascc_measures>();
        check(ascc_particles_measure(get(), &measures));
        return measures;
    }

  private:
    void check(ascc_status status) const
    {
        if (status != ASCC_OK)
            throw error(status, ascc_particles_message(get()));
    }
    std::size_t components(ascc_field field) const noexcept
    {
        return field == ASCC_MASS ? 1 : dimension();
    }
    static void expect(const char *name, const input &values, std::size_t components,
                       std::size_t count)
    {
        if (!values.absent() && values.count(components) != count)
            throw error(ASCC_ERROR_ARGUMENT,
                        name + (": " + std::to_string(values.count(components))) + " rows for " +
                            std::to_string(count) + " particles");
    }
    context context_;
    detail::owned<ascc_particles, ascc_particles_destroy> handle_;
};

/// What acts on the fluid from outside; none: the model's gravity alone.
struct forces {
    std::optional<std::array<double, 3>> gravity; // length unit / s^2; [2] is not read in 2D
    input acceleration;                           // a row for each fluid particle
};

/// A model bound to the memory that it needs to advance particles. One thread at a time.
class step
{
  public:
    step(const context &owner, const model &runs, const ascc_step_options &options)
    {
        ascc_step *made = nullptr;
        owner.check(ascc_step_create(owner.get(), runs.get(), &options, &made));
        handle_.reset(made);
    }
    step(const context &owner, const model &runs) : step(owner, runs, sized<ascc_step_options>())
    {
    }

    ascc_step *get() noexcept
    {
        return handle_.get();
    }
    const ascc_step *get() const noexcept
    {
        return handle_.get();
    }
    /// Advances the fluid by `count` time steps.
    void run(particles &set, std::int32_t count = 1)
    {
        check(ascc_step_run(get(), set.get(), nullptr, count));
    }
    void run(particles &set, const forces &outside, std::int32_t count = 1)
    {
        auto raw = sized<ascc_forces>();
        const auto acceleration = outside.acceleration.raw();
        if (!outside.acceleration.absent()) {
            if (outside.acceleration.count(set.dimension()) != set.count())
                throw error(ASCC_ERROR_ARGUMENT, "acceleration: a row for each particle is wanted");
            raw.acceleration = &acceleration;
        }
        if (outside.gravity)
            raw.gravity = outside.gravity->data();
        check(ascc_step_run(get(), set.get(), &raw, count));
    }
    std::size_t estimate(std::size_t fluid, std::size_t boundary) const noexcept
    {
        return ascc_step_estimate(get(), fluid, boundary);
    }
    void reserve(std::size_t fluid, std::size_t boundary)
    {
        check(ascc_step_reserve(get(), fluid, boundary));
    }
    ascc_step_statistics statistics() const
    {
        auto statistics = sized<ascc_step_statistics>();
        const ascc_status status = ascc_step_get_statistics(get(), &statistics);
        if (status != ASCC_OK)
            throw error(status, "statistics");
        return statistics;
    }

  private:
    void check(ascc_status status) const
    {
        if (status != ASCC_OK)
            throw error(status, ascc_step_message(get()));
    }
    detail::owned<ascc_step, ascc_step_destroy> handle_;
};

/// Several models of one fluid, the best last: each step runs what a budget of time allows.
class ladder
{
  public:
    /// seconds: that a step may take; 0: the last model always.
    ladder(const context &owner, const std::vector<const model *> &models, double seconds = 0.0)
        : ladder(owner, models, with_budget(seconds))
    {
    }
    ladder(const context &owner, const std::vector<const model *> &models,
           const ascc_ladder_options &options)
    {
        std::vector<const ascc_model *> raw;
        for (const model *one : models)
            raw.push_back(one ? one->get() : nullptr);
        ascc_ladder *made = nullptr;
        owner.check(ascc_ladder_create(owner.get(), raw.size(), raw.data(), &options, &made));
        handle_.reset(made);
    }

    ascc_ladder *get() noexcept
    {
        return handle_.get();
    }
    const ascc_ladder *get() const noexcept
    {
        return handle_.get();
    }
    void run(particles &set, std::int32_t count = 1)
    {
        check(ascc_ladder_run(get(), set.get(), nullptr, count));
    }
    void run(particles &set, const ascc_forces &outside, std::int32_t count = 1)
    {
        check(ascc_ladder_run(get(), set.get(), &outside, count));
    }
    void replay(particles &set, const std::vector<std::int32_t> &rungs)
    {
        check(ascc_ladder_replay(get(), set.get(), nullptr, rungs.data(),
                                 static_cast<std::int32_t>(rungs.size())));
    }
    void measure(particles &set)
    {
        check(ascc_ladder_measure(get(), set.get(), nullptr));
    }
    void set_budget(double seconds)
    {
        check(ascc_ladder_set_budget(get(), seconds));
    }
    ascc_ladder_statistics statistics() const
    {
        auto statistics = sized<ascc_ladder_statistics>();
        const ascc_status status = ascc_ladder_get_statistics(get(), &statistics);
        if (status != ASCC_OK)
            throw error(status, "statistics");
        return statistics;
    }
    /// The rung of every step so far.
    std::vector<std::int32_t> choices() const
    {
        std::vector<std::int32_t> rungs(static_cast<std::size_t>(ascc_ladder_step_count(get())));
        check(ascc_ladder_get_choices(get(), 0, rungs.size(), rungs.data()));
        return rungs;
    }
    std::vector<unsigned char> snapshot() const
    {
        std::vector<unsigned char> bytes(ascc_ladder_snapshot_size(get()));
        check(ascc_ladder_snapshot(get(), bytes.data(), bytes.size()));
        return bytes;
    }
    void restore(const std::vector<unsigned char> &bytes)
    {
        check(ascc_ladder_restore(get(), bytes.data(), bytes.size()));
    }

  private:
    static ascc_ladder_options with_budget(double seconds)
    {
        auto options = sized<ascc_ladder_options>();
        options.budget = seconds;
        return options;
    }
    void check(ascc_status status) const
    {
        if (status != ASCC_OK)
            throw error(status, ascc_ladder_message(get()));
    }
    detail::owned<ascc_ladder, ascc_ladder_destroy> handle_;
};

} // namespace ascc

#endif

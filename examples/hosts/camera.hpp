// Pictures of a particle set for the hosts here, as `ascc show` draws them. SPDX-License-Identifier: MIT
#ifndef CAMERA_HPP
#define CAMERA_HPP

#include <cstdio>
#include <stdexcept>
#include <string>

#include <ascc/ascc.hpp>

extern "C" {
#include "picture.h"
}

class camera
{
  public:
    // Shows the box from low to high; walls from row `first_wall` on.
    camera(std::string folder, std::size_t dimension, const std::array<double, 3> &low,
           const std::array<double, 3> &high, double spacing, std::size_t first_wall = 0)
        : folder_(std::move(folder)), first_wall_(first_wall)
    {
        view_.dimension = std::int32_t(dimension);
        for (std::size_t c = 0; c < 3; c++) {
            view_.low[c] = low[c];
            view_.high[c] = high[c];
        }
        view_.radius = 0.5 * spacing;
        view_.fastest = 2.0;
    }

    void draw(const ascc::particles &water, int frame, const char *scene, double seconds)
    {
        const auto walls = water.read<float>(ASCC_BOUNDARY, ASCC_POSITION);
        auto x = water.read<float>(ASCC_FLUID, ASCC_POSITION);
        auto v = water.read<float>(ASCC_FLUID, ASCC_VELOCITY);
        char path[512], text[96], error[256];
        std::snprintf(path, sizeof path, "%s/frame_%05d.png", folder_.c_str(), frame);
        std::snprintf(text, sizeof text, "%s, %.2f s", scene, seconds);
        view_.wall = walls.data() + first_wall_ * water.dimension();
        view_.walls = water.count(ASCC_BOUNDARY) - first_wall_;
        if (water.dimension() ==
            3) { // where pictures show no walls: bodies as the fastest particles
            const auto begin = walls.begin() + std::ptrdiff_t(3 * first_wall_);
            x.insert(x.end(), begin, walls.end());
            v.resize(x.size(), float(view_.fastest));
        }
        if (!ascc_picture_write(path, &view_, x.data(), v.data(), x.size() / water.dimension(),
                                text, error, sizeof error))
            throw std::runtime_error(error);
    }

  private:
    std::string folder_;
    std::size_t first_wall_;
    ascc_view view_ = {};
};

#endif

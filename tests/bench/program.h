// What the benchmarks' programs share: their arguments, their files, their medians.
#pragma once
#include <algorithm>
#include <charconv>
#include <cstddef>
#include <cstdio>
#include <fstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cairn_bench {

// std::invalid_argument, in words, unless the text is a number that is at least `least`.
template <class T> T number(const std::string& option, const std::string& text, T least) {
    T value{};
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size() || !(value >= least))
        throw std::invalid_argument(option + " takes a number, at least " + std::to_string(least) + ", not \"" + text + "\"");
    return value;
}

// A,B,C
inline std::vector<std::string> parts(const std::string& list) {
    std::vector<std::string> found;
    for (std::size_t begin = 0; begin <= list.size();) {
        const std::size_t end = std::min(list.find(',', begin), list.size());
        found.push_back(list.substr(begin, end - begin));
        begin = end + 1;
    }
    return found;
}

// "--name value" and "--name=value" as pairs; a flag's value is empty.
inline std::vector<std::pair<std::string, std::string>> pairsOf(const std::vector<std::string>& arguments,
                                                                const std::vector<std::string_view>& flags) {
    std::vector<std::pair<std::string, std::string>> pairs;
    for (std::size_t i = 0; i < arguments.size(); ++i) {
        const std::string& argument = arguments[i];
        const std::size_t equals = argument.find('=');
        if (std::find(flags.begin(), flags.end(), argument) != flags.end())
            pairs.emplace_back(argument, "");
        else if (argument.rfind("--", 0) == 0 && equals != std::string::npos)
            pairs.emplace_back(argument.substr(0, equals), argument.substr(equals + 1));
        else if (i + 1 < arguments.size())
            pairs.emplace_back(argument, arguments[i + 1]), ++i;
        else
            pairs.emplace_back(argument, "");
    }
    return pairs;
}

// The arguments as they were given, each after a blank.
inline std::string joined(const std::vector<std::string>& arguments) {
    std::string text;
    for (const std::string& argument : arguments)
        text += " " + argument;
    return text;
}

// Writes a file whole or not at all; none where the path is empty. Throws std::runtime_error.
inline void save(const std::string& text, const std::string& path) {
    if (path.empty())
        return;
    const std::string half = path + ".part";
    std::ofstream file(half, std::ios::binary);
    file << text;
    file.close();
    if (!file || std::rename(half.c_str(), path.c_str()) != 0)
        throw std::runtime_error(path + " could not be written");
}

inline double median(const std::vector<double>& unsorted) {
    std::vector<double> values = unsorted;
    std::sort(values.begin(), values.end());
    const std::size_t middle = values.size() / 2;
    return values.size() % 2 == 1 ? values[middle] : 0.5 * (values[middle - 1] + values[middle]);
}

} // namespace cairn_bench

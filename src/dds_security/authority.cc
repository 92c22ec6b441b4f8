#include "dds_security/authority.h"

#include <cstdint>
#include <ctime>
#include <stdexcept>

#include <openssl/rand.h>
#include <openssl/x509v3.h>

#include "dds_security/openssl.h"

namespace fastcycle::dds_security {
namespace {

constexpr long kDay = 24L * 60 * 60;

void need(bool is_done) {
  if (!is_done) {
    throw std::runtime_error("OpenSSL refuses to make a key, a certificate or a signature");
  }
}

std::string pem_of(X509& certificate) {
  const Bio memory(::BIO_new(::BIO_s_mem()));
  need(memory != nullptr && ::PEM_write_bio_X509(memory.get(), &certificate) == 1);
  return text_of(*memory);
}

std::string pem_of(EVP_PKEY& key) {
  const Bio memory(::BIO_new(::BIO_s_mem()));
  need(memory != nullptr &&
       ::PEM_write_bio_PrivateKey(memory.get(), &key, nullptr, nullptr, 0, nullptr, nullptr) == 1);
  return text_of(*memory);
}

void add_extension(X509& certificate, X509& issuer, int kind, const char* value) {
  X509V3_CTX context;
  X509V3_set_ctx_nodb(&context);
  ::X509V3_set_ctx(&context, &issuer, &certificate, nullptr, nullptr, 0);
  X509_EXTENSION* const extension = ::X509V3_EXT_conf_nid(nullptr, &context, kind, value);
  need(extension != nullptr);
  const bool is_added = ::X509_add_ext(&certificate, extension, -1) == 1;
  ::X509_EXTENSION_free(extension);
  need(is_added);
}

/// Without issuer, extensions and signature.
X509Ptr begin_certificate(EVP_PKEY& key, const std::string& name, Days valid) {
  X509Ptr certificate(::X509_new());
  need(certificate != nullptr);
  std::uint64_t serial = 0;
  need(::RAND_bytes(reinterpret_cast<unsigned char*>(&serial), sizeof(serial)) == 1);
  ::X509_set_version(certificate.get(), X509_VERSION_3);
  ::ASN1_INTEGER_set_uint64(::X509_get_serialNumber(certificate.get()), serial >> 1U);
  ::X509_gmtime_adj(X509_getm_notBefore(certificate.get()), -kDay);  // Clocks may differ.
  need(::X509_time_adj_ex(X509_getm_notAfter(certificate.get()), static_cast<int>(valid.count()), 0,
                          nullptr) != nullptr);
  need(::X509_set_pubkey(certificate.get(), &key) == 1);
  need(::X509_NAME_add_entry_by_txt(::X509_get_subject_name(certificate.get()), "CN", MBSTRING_UTF8,
                                    reinterpret_cast<const unsigned char*>(name.data()),
                                    static_cast<int>(name.size()), -1, 0) == 1);
  return certificate;
}

}  // namespace

Identity make_authority(const std::string& name, Days valid) {
  const Key key(EVP_EC_gen("P-256"));
  need(key != nullptr);
  const X509Ptr certificate = begin_certificate(*key, name, valid);
  need(::X509_set_issuer_name(certificate.get(), ::X509_get_subject_name(certificate.get())) == 1);
  add_extension(*certificate, *certificate, NID_basic_constraints, "critical,CA:TRUE,pathlen:0");
  add_extension(*certificate, *certificate, NID_key_usage,
                "critical,keyCertSign,cRLSign,digitalSignature");
  add_extension(*certificate, *certificate, NID_subject_key_identifier, "hash");
  need(::X509_sign(certificate.get(), key.get(), ::EVP_sha256()) != 0);
  return {.certificate = pem_of(*certificate), .key = pem_of(*key)};
}

Identity issue(const Identity& authority, const std::string& name, Days valid) {
  const X509Ptr issuer = certificate_of(authority.certificate);
  const Key issuer_key = key_of(authority.key);
  const Key key(EVP_EC_gen("P-256"));
  need(issuer != nullptr && issuer_key != nullptr && key != nullptr);
  const X509Ptr certificate = begin_certificate(*key, name, valid);
  const ASN1_TIME* const end = ::X509_get0_notAfter(issuer.get());
  if (::ASN1_TIME_compare(::X509_get0_notAfter(certificate.get()), end) > 0) {
    need(::X509_set1_notAfter(certificate.get(), end) == 1);
  }
  need(::X509_set_issuer_name(certificate.get(), ::X509_get_subject_name(issuer.get())) == 1);
  add_extension(*certificate, *issuer, NID_basic_constraints, "critical,CA:FALSE");
  add_extension(*certificate, *issuer, NID_authority_key_identifier, "keyid:always");
  need(::X509_sign(certificate.get(), issuer_key.get(), ::EVP_sha256()) != 0);
  return {.certificate = pem_of(*certificate), .key = pem_of(*key)};
}

std::string sign(const Identity& authority, std::string_view document) {
  // With the header of a text in what is signed: that is how DDS reads it.
  constexpr int kFlags = PKCS7_TEXT | PKCS7_DETACHED | PKCS7_STREAM;
  const X509Ptr certificate = certificate_of(authority.certificate);
  const Key key = key_of(authority.key);
  const Bio in = read_from(document);
  const Bio out(::BIO_new(::BIO_s_mem()));
  need(certificate != nullptr && key != nullptr && in != nullptr && out != nullptr);
  const Pkcs7 signature(::PKCS7_sign(certificate.get(), key.get(), nullptr, in.get(), kFlags));
  need(signature != nullptr &&
       ::SMIME_write_PKCS7(out.get(), signature.get(), in.get(), kFlags) == 1);
  return text_of(*out);
}

std::chrono::sys_seconds end_of(std::string_view certificate) {
  const X509Ptr parsed = certificate_of(certificate);
  std::tm time{};
  need(parsed != nullptr && ::ASN1_TIME_to_tm(::X509_get0_notAfter(parsed.get()), &time) == 1);
  return std::chrono::sys_seconds(std::chrono::seconds(::timegm(&time)));
}

}  // namespace fastcycle::dds_security
